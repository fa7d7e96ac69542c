"""A diagnosis as sentences, figures, diagnosis.json, a page and a corrected device file."""
