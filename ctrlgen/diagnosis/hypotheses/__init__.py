"""Hypotheses of what a model leaves out: every law at every place of a device, and what is believed of it beforehand."""
