"""Which numbers of the device must move together for the readings to stay the same: m, c, k and k_f of a driven axis in proportion.

What the readings alone do not tell, the file decides: a wrong force constant beside a wrong stiffness is then told as a wrong mass.
"""

from __future__ import annotations

import numpy as np

from ctrlgen.diagnosis.settings import VERDICT
from ctrlgen.estimation.fit import Fit
from ctrlgen.estimation.hypothesis import PARAMETER


def moved_together(fit: Fit, k: int) -> tuple[str, ...]:
    """The paths of the numbers that the file states and that undo a change of cause k, a number of the device, in the readings; none
    where the readings tell it alone.

    Of the slopes S of the readings by the logarithms of the numbers, apart from what initial states can do: the shortest x that
    minimises |s_k + S x|. Nothing is told of k where a tenth of s_k + S x changes the readings by less than their noise.
    """
    free = fit.structure.free_parameters
    found = [i for i, u in enumerate(free) if u.cause == k]
    stated = [i for i, u in enumerate(free) if u.cause is None and u.sd]
    if fit.structure.causes[k].effect != PARAMETER or len(found) != 1 or not stated:
        return ()
    readings = sum(samples * channels for samples, channels in fit.shapes)
    begun = fit.J[:readings, len(free) :]
    slopes = fit.J[:readings, [*found, *stated]] * fit.theta[[*found, *stated]]
    slopes -= begun @ np.linalg.lstsq(begun, slopes, rcond=None)[0]
    with_it = np.linalg.lstsq(slopes[:, 1:], -slopes[:, 0], rcond=1e-6)[0]
    if VERDICT.undone * np.linalg.norm(slopes[:, 0] + slopes[:, 1:] @ with_it) > 1:
        return ()
    largest = np.abs(with_it).max(initial=0.0)
    return tuple(free[i].path for i, x in zip(stated, with_it, strict=True) if abs(x) > VERDICT.undone * largest)
