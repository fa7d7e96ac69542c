"""Devices whose physics their user writes as functions."""
