"""Expressions, numbers and rules of the C that is written."""
