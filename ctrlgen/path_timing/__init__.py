"""The fastest path: by which law of time a path is followed in the shortest time within all limits."""
