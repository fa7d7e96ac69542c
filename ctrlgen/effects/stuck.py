"""A dead channel: it reports a number, whatever happens."""

import numpy as np

from ctrlgen.effects import Effect, Param, Place


class Stuck(Effect):
    """Delta y = -s (y - y_0), s = 1 for a channel that stands at y_0. Holds for one that is dead all the time."""

    place = Place.SENSOR
    stage = 4
    rarity = 2.3
    source = "R. Isermann, Fault-Diagnosis Systems (2006): sensor faults"
    params = (
        Param("share", "1", (0.0, 1.2), "1 where nothing of the motion is seen", off=0.0, expected=(0.8, 1.2)),
        Param("level", "channel", (-1e3, 1e3), "what is reported", grid=(0.0, 1.0)),
    )

    def term(self, s, p):
        return -p.share * (s.value - p.level)

    @classmethod
    def read_off(cls, readings):
        return ({"share": 1.0, "level": float(readings[0])}, np.inf) if np.ptp(readings) == 0 else None
