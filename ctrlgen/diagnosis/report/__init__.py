"""Reports of a diagnosis: sentences, plots, diagnosis.json, report.html and the corrected device file device.next.toml."""
