"""Every number that the papers print beside the program's own: printed, ours, difference, status, reason."""
