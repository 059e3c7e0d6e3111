"""Fitting the reduced model to recordings of a plant. Imports `model`."""
