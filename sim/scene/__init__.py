"""Where the arm is: water, and what else there is. Imports the ground of `sim` only."""
