"""Link, writhe and twist of centrelines with frames, recorded or live. Imports the ground of `sim` only."""
