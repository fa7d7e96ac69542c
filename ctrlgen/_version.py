"""The version of ctrlgen; part of every generated header."""

__version__ = "0.1.0"
