"""The numbers of a model from recordings: noise, simulation with sensitivities, fit, intervals, residual tests."""
