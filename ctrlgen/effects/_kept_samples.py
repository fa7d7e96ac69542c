"""What laws of a reading that look back by samples share: the readings that they keep."""

from __future__ import annotations

from math import ceil
from typing import ClassVar

from ctrlgen.core.units import Quantity
from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Place, State

SIZES = {"y": ("channel", 1.0), "r": ("channel/s", 10.0), "c": ("channel/s^2", 100.0)}
MOST = 1000  # each three states of a delay: 20 s and 1.5 GB to build and discretise, by the second power of them
FREE_SAMPLES = 4  # kept beyond twice the file's amplitude where that is free


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


def readings_kept(samples: int, signals: str) -> tuple[State, ...]:
    """The `signals` of so many samples and of the present one: "y" readings, "r" slopes, "c" second derivatives."""
    return tuple(State(f"{name}{k}", *SIZES[name], stepped=True) for name in signals for k in range(samples + 1))


class LooksBack(Effect, listed=False):
    """Of a reading that is late: keeps the samples that the file's amplitude [s] takes, over twice as many where that is free."""

    place = Place.SENSOR
    family = Family.TIMING
    requires = frozenset({"sample_time"})
    signals: ClassVar[str]

    def kept(self, sample_time: float | None, free: bool) -> tuple[State, ...]:
        age = samples_in(self.values[self.amplitude().name], sample_time)
        return readings_kept(max(2 * age + FREE_SAMPLES if free else age, 1), self.signals)

    def reaches(self, sample_time: float) -> float:
        return 2 * self.values[self.amplitude().name].si + FREE_SAMPLES * sample_time

    @classmethod
    def samples(cls, s: LawInputs) -> int:
        """How many samples before the present one are kept."""
        return len(vars(s.states)) // len(cls.signals) - 1

    @classmethod
    def sample(cls, s: LawInputs, k: int) -> list[Expression]:
        """The signals of the sample k before the present one."""
        return [getattr(s.states, f"{name}{k}") for name in cls.signals]

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        slope = (s.value - s.states.y0) / s.sample_time if s.rate is None else s.rate
        present = {"y": s.value, "r": slope, "c": 0.0 if s.second_rate is None else s.second_rate}
        new = {f"{name}0": present[name] for name in self.signals}
        for k in range(1, self.samples(s) + 1):
            new |= {f"{name}{k}": getattr(s.states, f"{name}{k - 1}") for name in self.signals}
        if s.rate is None:
            new["r1"] = (s.value - s.states.y1) / (2 * s.sample_time)
        return new
