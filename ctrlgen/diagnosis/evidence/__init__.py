"""Analyses beside the verdict: where the mismatch is, what could have been detected, what to record next."""
