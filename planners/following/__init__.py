"""Controllers, which follow a plan, and what they see of the arm. Imports `contracts`, `asking`, `model`, `solving.plan`."""
