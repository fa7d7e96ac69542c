"""Readings that pile up at one value while the drive goes on: a sensor at the end of its range, or a stage at a stop.

Near its largest value a motion that turns, as a sine, has about 2.4 times as many readings as next to that; one that ends there has many
times as many, all within the noise. What then is missing of the motion looks like many laws, each of which takes some of it away: what
else the device lacks shows only beside a limit of the sensor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ctrlgen.diagnosis.settings import PILES
from ctrlgen.effects import Place
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, DataHints, Hypothesis, nominal_physics
from ctrlgen.model.effect_terms import channels
from ctrlgen.recordings.recording import Record

ENDS = "reading_ends"  # name of a start value in `estimation.priors`


def ends_of_readings(fitter: Fitter, fit: Fit) -> dict[tuple[Place, int], dict[str, tuple[float, ...]]]:
    """Of each sensor the ends of its readings to fit at which they pile up (`piled_ends`)."""
    sensors = [c.name for c in channels(nominal_physics(fit.structure.device), Place.SENSOR)]
    read = [(i, c.removeprefix("reading.")) for i, c in enumerate(fitter.recording.channels)]
    return {
        (Place.SENSOR, sensors.index(name)): {ENDS: tuple(piled_ends(fitter.fit_records, i, fitter.noise.floor[i]))}
        for i, name in read
        if name in sensors
    }


def limits_where_readings_pile_up(
    fitter: Fitter, fit: Fit, offered: Sequence[Hypothesis]
) -> list[tuple[Hypothesis, dict[str, float]]]:
    """The laws offered that begin at an end of the readings, with each end at which those pile up as a start [SI]."""
    ends, device, found = ends_of_readings(fitter, fit), fit.structure.device, []
    for h in offered:
        if h.effect == PARAMETER or not any(h.prior.of(p).start_from_data == ENDS for p in h.law.params):
            continue
        amplitude, channel = h.law.amplitude(), h.channel_on(device)
        hints = DataHints(suggested=ends.get((h.law.place, h.acts_on(device)[0]), {}))
        present = sum(h.prior.of(amplitude).fixed_range or h.bounds(amplitude, channel)) / 2
        found += [(h, {amplitude.name: present} | shape) for shape in h.shapes(channel, hints)]
    return found


def piled_ends(records: Sequence[Record], i: int, noise: float) -> list[float]:
    """The values [SI] at either end of what channel `i` reads at which readings pile up, as their mean, while a drive goes on by
    `PILES.moves` of its range: `PILES.fewest` of them or more within the `noise`, `PILES.crowd` times as many as beside them."""
    read = np.concatenate([r.observed[r.valid[:, i], i] for r in records] or [np.zeros(0)])
    drive = np.concatenate([r.drive[r.valid[:, i]] for r in records])
    width = PILES.width * noise
    if not len(read) or not 0 < width < PILES.narrow * np.ptp(read):
        return []
    span, ends = np.ptp(drive, axis=0), []
    for side in (1, -1):
        depth = float(np.max(side * read)) - side * read
        at_end, beside = depth < width, int(np.sum((depth >= width) & (depth < 2 * width)))
        count, end = int(at_end.sum()), float(np.mean(read[at_end]))
        moved = np.ptp(drive[at_end], axis=0)
        goes_on = bool((moved > PILES.moves * span)[span > 0].any())
        if count >= PILES.fewest and count >= PILES.crowd * max(beside, 1) and goes_on and side * end > 0:
            ends.append(end)
    return ends
