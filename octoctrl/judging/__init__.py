"""What was planned against what happened, and the verdict. Imports `carrying`."""
