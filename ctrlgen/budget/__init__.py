"""The error budget of a path: what every uncertain number of the device, its surroundings and its electronics does to the pose."""
