"""What can be asked for: primitives and their composition, phases, goals, tasks. Imports the vocabulary of `sim`."""
