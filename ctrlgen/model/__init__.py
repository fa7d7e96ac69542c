"""Device -> one symbolic model, and what is computed with it: one sample, a simulation, the inverse, the feedforward controller."""
