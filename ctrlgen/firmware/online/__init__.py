"""The online controller as C."""
