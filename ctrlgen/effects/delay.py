"""A reading that is late by a fixed time."""

import casadi as ca

from ctrlgen.effects import Apart, Between, Expression, LawInputs, LawNumbers, Param
from ctrlgen.effects._kept_samples import LooksBack, readings_kept


class Delay(LooksBack):
    """Delta y(t) = y(t - tau) - y(t), by the quartic polynomial through value and slope at both neighbouring samples
    and the second derivative just after the older one; where the motion gives no derivatives, by a cubic with slopes from samples.

    Keeps the samples that the file's delay takes, over twice as many where it is free. Holds for frequencies below rate/5.
    """

    order = 4  # what a filter or a mean over a window leaves is sent
    source = "T. I. Laakso et al., IEEE Signal Processing Magazine 13 (1996) 30: splitting the unit delay"
    params = (Param("delay", "ms", (0.0, 3.6e6), "age of the reading", off=0.0),)  # an hour: dead time of a process
    moves_in_time = True
    late_by = 1.0
    signals = "yrc"
    states = readings_kept(1, signals)  # of a delay that is off
    apart = Apart.LATE

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        h, total, samples = s.sample_time, 0.0, self.samples(s)
        D = ca.fmin(p.delay / h, samples)
        for k in range(samples):  # w from 0 at sample k, counted backwards, to 1 at sample k + 1
            w, near, old = D - k, self.sample(s, k), self.sample(s, k + 1)
            second = None if s.second_rate is None else h**2 * old[2]
            between = Between(near[0], old[0], h * near[1], h * old[1], second)
            inside = (w >= 0) * (w < 1) if k + 1 < samples else w >= 0
            total += ca.if_else(inside, near[0] - s.value + between.change(w), 0.0)
        return total
