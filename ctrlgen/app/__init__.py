"""What a user starts: the command line, the pipeline of a scenario, batches of diagnoses, examples."""
