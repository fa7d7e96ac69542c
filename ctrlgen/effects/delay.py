"""A reading that is late by a fixed time."""

import casadi as ca

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place, State
from ctrlgen.effects._kept_samples import readings_kept, samples_in

FREE_SAMPLES = 4  # kept beyond twice the file's delay where the delay is free


class Delay(Effect):
    """Delta y(t) = y(t - tau) - y(t), by the quartic polynomial through value and slope at both neighbouring samples
    and the second derivative just after the older one; where the motion gives no derivatives, by a cubic with slopes from samples.

    Keeps the samples that the file's delay takes, over twice as many where it is free. Holds for frequencies below rate/5.
    """

    place = Place.SENSOR
    family = Family.TIMING
    order = 3
    requires = frozenset({"sample_time"})
    source = "T. I. Laakso et al., IEEE Signal Processing Magazine 13 (1996) 30: splitting the unit delay"
    params = (Param("delay", "ms", (0.0, 3.6e6), "age of the reading", off=0.0),)  # an hour: dead time of a process
    moves_in_time = True
    states = readings_kept(1)  # of a delay that is off
    apart = True

    def kept(self, sample_time: float | None, free: bool) -> tuple[State, ...]:
        age = samples_in(self.values["delay"], sample_time)
        return readings_kept(max(2 * age + FREE_SAMPLES if free else age, 1))

    def reaches(self, sample_time: float) -> float:
        return 2 * self.values["delay"].si + FREE_SAMPLES * sample_time

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        h, total, samples = s.sample_time, 0.0, len(vars(s.states)) // 3 - 1
        D = ca.fmin(p.delay / h, samples)
        for k in range(samples):  # w from 0 at sample k, counted backwards, to 1 at sample k + 1
            near, old = ([getattr(s.states, f"{name}{j}") for name in "yrc"] for j in (k, k + 1))
            w, slope = D - k, h * near[1]
            gap, turn = old[0] - near[0] + slope, slope - h * old[1]
            fourth = 0.0 if s.second_rate is None else (h**2 * old[2] + 6 * gap - 4 * turn) / 2
            third = turn - 2 * gap - 2 * fourth
            between = w * (w * (gap - third - fourth + w * (third + w * fourth)) - slope)
            inside = (w >= 0) * (w < 1) if k + 1 < samples else w >= 0
            total += ca.if_else(inside, near[0] - s.value + between, 0.0)
        return total

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        slope = (s.value - s.states.y0) / s.sample_time if s.rate is None else s.rate
        new = {"y0": s.value, "r0": slope, "c0": 0.0 if s.second_rate is None else s.second_rate}
        for k in range(1, len(vars(s.states)) // 3):
            new |= {f"{name}{k}": getattr(s.states, f"{name}{k - 1}") for name in "yrc"}
        if s.rate is None:
            new["r1"] = (s.value - s.states.y1) / (2 * s.sample_time)
        return new
