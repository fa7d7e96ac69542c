"""Concealed cases for `ctrlgen diagnose`: independent plants, a generator, a scorer and opponents.

Nothing here imports ctrlgen, and nothing of ctrlgen is copied: a diagnosis proved on data made by its own equations
and its own integrator would prove little. The program under test is run as a command, on files.
"""
