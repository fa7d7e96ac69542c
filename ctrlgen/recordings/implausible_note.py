"""A note that outranks what is found: the recording cannot be right as it is stated."""


class Implausible(str):
    """A note on what cannot be of the device as it is stated, or of readings taken with their drives: an answer begins with it, and a
    reader who refuses the recording tells it as the likely reason."""
