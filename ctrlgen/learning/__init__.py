"""Learning from runs: the drives of the next run from what the runs before it repeat."""
