"""What every plant shares: the clock, recordings, batches. Imports `body`, `scene` and `activation`."""
