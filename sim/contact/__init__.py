"""Touching the world: distances, friction with anchors, rigid bodies. Imports the ground of `sim`, `scene` and `physics`."""
