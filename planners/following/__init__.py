"""Feedback along a plan. Imports `asking`, `model`, `solving.plan`."""
