"""Describe a flexure nanopositioner once; solve its trajectories, generate its C, prove that the C is right.

outcome = ctrlgen.run("scenarios/circle20", "out/circle20")
print(outcome.passed, outcome.solution.tightest)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
