"""ctrlgen: describe a flexure nanopositioner once; solve, generate C, compare."""

__version__ = "0.1.0"
