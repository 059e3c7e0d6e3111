"""The stability laboratory: random runs, each accurate, refused or stopped with the reason. Imports `carrying` and `judging`."""
