"""The reduced model: sections of constant strain without inertia. Imports the vocabulary of `sim`."""
