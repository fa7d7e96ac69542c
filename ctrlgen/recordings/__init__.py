"""Measurement files -> recordings in SI: read, checked, marked, never filled in."""
