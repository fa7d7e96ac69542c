"""Commented files to begin with: a device of some kind, a scenario for a device."""
