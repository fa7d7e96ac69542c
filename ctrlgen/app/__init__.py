"""What a user starts: the command line, the whole job of a scenario, batches."""
