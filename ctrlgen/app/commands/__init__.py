"""The commands, by what they work on: parse, call, print. They decide nothing."""
