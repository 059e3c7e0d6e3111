"""The full arm of 197 rods. Imports all of `sim`; of `rod` nothing in the long run."""
