"""Octoctrl for other programs: sweeps over any executor, environments for learning. Imports `carrying` and `judging`."""
