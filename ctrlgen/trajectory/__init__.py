"""What should be followed, whether it can be, and the drives that follow it."""
