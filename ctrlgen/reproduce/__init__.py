"""Every number the papers print and the program can compute: printed, ours, difference, status."""
