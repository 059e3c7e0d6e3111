"""Goals, one kind to a file: what has to hold at the end of a phase or throughout. Imports the registry and the contracts."""
