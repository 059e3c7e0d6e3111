"""What is simulated: an arm's outline, its muscles and their laws, its counts of rods; other hydrostats. Imports the ground of `sim`."""
