"""Whether the generated C does what its references do."""
