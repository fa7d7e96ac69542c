"""Recordings -> which physics the device description leaves out."""
