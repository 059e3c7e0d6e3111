"""From a task to a plan: reachability, trajectory optimisation, the plan and its status. Imports `asking`, `model`, `fitting`."""
