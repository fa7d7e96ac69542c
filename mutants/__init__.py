"""Mutation testing: wrong lines put into ctrlgen one at a time, each run against the tests that execute it.

`areas` which files are mutated, `draw` which mutants there are and which are left out, `seen` which tests execute which line,
`trial` one mutant in a copy of the tree. Mutations by cosmic-ray's operators, lines by coverage.py.
"""
