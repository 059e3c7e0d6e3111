"""From a task to a plan: reachability, search, optimisation, the plan and its status. Imports `asking`, `model`, `fitting`."""
