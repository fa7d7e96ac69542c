"""Which causes a recording supports: screening, candidate models, their comparison, the verdict."""
