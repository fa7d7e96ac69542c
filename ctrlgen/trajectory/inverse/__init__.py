"""From a path to the drives that follow it, sample by sample."""
