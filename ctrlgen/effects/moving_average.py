"""A sensor that averages its readings over a window"""

import casadi as ca

from ctrlgen.effects import Apart, Between, Expression, LawInputs, LawNumbers, Param
from ctrlgen.effects._kept_samples import LooksBack, readings_kept


class MovingAverage(LooksBack):
    """Delta y(t) = (1/W) integral of y from t - W to t, less y(t): a boxcar. Within a sample the integral is that of the cubic polynomial
    through value and slope at both ends, over whole samples of h

        h (y_0/2 + y_1 + ... + y_n/2) + h^2/12 (y'_n - y'_0).

    Keeps the samples within the window, over twice as many where it is free. Holds for frequencies below rate/5.
    """

    order = 3  # of what is filtered; before it is sent
    source = "S. W. Smith, The Scientist and Engineer's Guide to Digital Signal Processing (1997), chapter 15"
    params = (Param("window", "ms", (0.0, 6e4), "time over which a reading is the mean", off=0.0),)
    late_by = 0.5
    signals = "yr"
    states = readings_kept(1, signals)  # of a window that is off
    apart = Apart.MEAN

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        h, total, samples, whole = s.sample_time, 0.0, self.samples(s), 0.0
        D = ca.fmin(p.window / h, samples)
        divisor = ca.if_else(D >= 1, D, 1.0)  # within a sample nothing is divided
        for k in range(samples):  # w from 0 at sample k, counted backwards, to 1 at sample k + 1
            w, near, old = D - k, self.sample(s, k), self.sample(s, k + 1)
            mean = near[0] - s.value + Between(near[0], old[0], h * near[1], h * old[1]).mean_change(w)
            inside = (w >= 0) * (w < 1) if k + 1 < samples else w >= 0
            total += ca.if_else(inside, (whole + w * mean) / divisor if k else mean, 0.0)
            whole += (near[0] + old[0]) / 2 - s.value + h * (old[1] - near[1]) / 12
        return total

    @classmethod
    def from_plainer(cls, numbers: dict[str, float]) -> dict[str, float]:
        """A mean comes late by half of its window, and what filters of two poles take out or filter by 2 D tau."""
        filtered = {"share", "tau", "damping"} <= numbers.keys()
        late = 2 * numbers["damping"] * numbers["tau"] * numbers["share"] if filtered else numbers.get("delay", 0.0)
        return {"window": max(2 * late, 0.0)}
