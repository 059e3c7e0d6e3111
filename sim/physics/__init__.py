"""Laws that every plant shares, as free functions: fibres, rotations, drag, contact, tridiagonal systems. Imports the body only."""
