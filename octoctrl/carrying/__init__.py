"""Planning, identifying and carrying out. Imports `files`."""
