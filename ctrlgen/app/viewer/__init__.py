"""`ctrlgen view`: result folders as pages on the loopback address. It reads and never writes."""
