"""How many samples a law that looks back keeps."""

from math import ceil

from ctrlgen.core.units import Quantity
from ctrlgen.effects._parameter import State

SIZES = {"y": ("channel", 1.0), "r": ("channel/s", 10.0), "c": ("channel/s^2", 100.0)}
MOST = 1000  # each three states of a delay: 20 s and 1.5 GB to build and discretise, by the second power of them


def samples_in(age: Quantity, sample_time: float | None) -> int:
    """Samples of `sample_time` [s] in an `age`, one begun being one more. Raises ValueError where a model cannot keep so many."""
    step = sample_time or float("inf")
    count = ceil(age.si / step)
    if count > MOST:
        raise ValueError(
            f"{age.text} is {count} samples of {step:.4g} s, which the model keeps one by one; write {MOST * step:.4g} s or "
            f"less, or sample every {age.si / MOST:.4g} s or more"
        )
    return count


def readings_kept(samples: int) -> tuple[State, ...]:
    """The readings of so many samples and the present one, with slopes and second derivatives."""
    return tuple(State(f"{name}{k}", *SIZES[name], stepped=True) for name in SIZES for k in range(samples + 1))
