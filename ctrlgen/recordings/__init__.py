"""Measurement files -> recordings in SI: read, preprocessed, validated, doubtful samples marked and never filled in."""
