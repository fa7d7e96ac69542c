"""Supporting analyses: where the residual is, what was detectable, what to record next, bootstrap intervals."""
