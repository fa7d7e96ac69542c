"""Model and solution -> C99: the printer, what the templates need, and the folder; nothing else writes C."""
