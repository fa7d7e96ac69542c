"""Model-free shares: how much of a residual is a function of position, direction, history and so on, whatever the law."""
