"""Configurations, plans and runs as files. Imports the ground of the front door."""
