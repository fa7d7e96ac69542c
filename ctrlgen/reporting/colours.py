"""The colours of every drawing."""

# safe for the colour-blind, a pair per stage
COLOURS = ("#0072b2", "#56b4e9", "#d55e00", "#e69f00", "#009e73", "#7fc97f")
