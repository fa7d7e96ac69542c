"""The run-time constants of a specimen, fitted to a short recording of it."""
