"""The solved drives as C that plays them."""
