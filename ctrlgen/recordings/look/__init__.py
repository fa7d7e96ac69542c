"""What a measurement file holds, what is odd about it, and a recording.toml to begin with."""
