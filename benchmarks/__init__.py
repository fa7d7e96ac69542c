"""Speed of ctrlgen against named peers, measured side by side: `python -m benchmarks --help`."""
