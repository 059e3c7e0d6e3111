"""Pictures of runs. Imports `judging`."""
