"""The plant as a co-simulation unit."""
