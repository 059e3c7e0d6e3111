"""Benchmarks that anyone can repeat. Imports `carrying` and `judging`."""
