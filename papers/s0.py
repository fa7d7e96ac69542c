"""Every number of S0: Tables 1 to 4, eq. (1) to (16), the errors of section 5.

Numbers that follow from the hexapod's dimensions are computed with those that the authors calculated with, and again with
the printed ones (`taken_literally`). Left out: measured and commanded poses, which are data. What is computed from
Table 4 has the propagated rounding of its three digits as tolerance.
"""

from __future__ import annotations

import numpy as np

from ctrlgen.core.units import from_si
from ctrlgen.devices.meso_hexapod import MesoHexapod
from ctrlgen.devices.sensor import READING_TIME, READINGS, AutocollimatorSensor
from ctrlgen.recordings.pose_errors import CHANNELS, parasitic, pose_errors

from . import s0_geometry, s0_jacobians
from .rounding import half_units, propagated_rounding
from .row import PrintedNumber, beside_literal, no_number
from .s0_data import PaperRecordings, load_s0
from .s0_tables import DIGITS, EXTREMES, NORMS, SCALE, TABLE_3, UNITS, s0_row

ROUNDED = "computed from Table 4, which is rounded to three digits"
CALCULATED = (
    "follows with r_a = 64.291 mm, r_b = 138.924 mm, the angles from c_1 ... c_4 unrounded, eq. (9), and actuators 2y, 3x and "
    "3y reversed"
)


SET_UP = "photograph or scheme of the set-up"
REDRAWN = "redrawn on the page from our own errors; its numbers are those of Table 3 and section 5.2"
HOME = "prints neither; a recording with returns gives both with intervals by `ctrlgen calibrate --jacobian`, and Table 4 has none"
CARRIED = "the sd of the shipped device's sensor laws, taken as even within the printed bound"
WITHOUT_NUMBER = (
    ("Fig. 1", SET_UP),
    ("Fig. 2", "scheme of eq. (1) and (2)"),
    ("Fig. 3", "scheme of Table 1"),
    ("Fig. 4", SET_UP),
    ("Fig. 5", SET_UP),
    *((f"Fig. {k}", REDRAWN) for k in range(6, 11)),
    (
        "Section 3.1, alignment of the beams, 2E-5 deg",
        "shortens a reading by half its square, 6e-14 of it: no law of it is needed",
    ),
    ("Section 3.1, returns to home, repeatability and drift", HOME),
)


def rows(device: MesoHexapod | None = None) -> list[PrintedNumber]:
    """The printed numbers in the order of the paper; `device` replaces the one as calculated."""
    printed, calculated, recordings = load_s0()
    corrected, literal = (_of_device(d, recordings) for d in (device or calculated, printed))
    return [
        *beside_literal(corrected, literal, CALCULATED),
        *s0_geometry.from_table_4(calculated, recordings),
        *s0_geometry.equations(calculated),
        *s0_jacobians.table_2(printed, recordings),
        *s0_jacobians.equation_16(recordings),
        *_counts(recordings),
        *_workspace(recordings),
        *_section_5(recordings),
        *_instruments(calculated),
        *(no_number("S0", what, reason) for what, reason in WITHOUT_NUMBER),
    ]


def _instruments(device: MesoHexapod) -> list[PrintedNumber]:
    """What section 3 states of the instruments: as the device carries it, and what this makes of poses."""
    leans = [e.values["tilt"].sd or 0.0 for e in device.effect if e.kind in ("mirror_tilt", "face_tilt")]
    (seen, *_) = (s for s in device.sensor if isinstance(s, AutocollimatorSensor))
    bound = float(from_si(max(leans) * np.sqrt(3), "deg"))
    return [
        s0_row("Section 3, faces of the cube, orthogonal within", "1.4E-3", "deg", bound, reason=CARRIED),
        s0_row("Section 3.1, readings averaged at a pose", "40", "1", READINGS),
        s0_row("Section 3.1, time of these readings", "30", "s", READING_TIME),
        s0_row(
            "Section 3.2, accuracy of the autocollimator",
            "7",
            "1e-5 deg",
            1e5 * float(from_si(seen.accuracy.si, "deg")),
        ),
        s0_row(
            "Section 3.2, range of the autocollimator",
            "0.55",
            "deg",
            float(from_si(seen.ends[1] - seen.ends[0], "deg")),
        ),
    ]


def _workspace(data: PaperRecordings) -> list[PrintedNumber]:
    """The workspace that the abstract states: what Table 4 commands."""
    most = np.abs(data.commanded / SCALE).max(0)
    named = (("rotation", "0.2", "deg", most[:3]), ("translation", "200", "um", most[3:]))
    return [s0_row(f"Abstract, workspace, {what}", text, unit, values.max()) for what, text, unit, values in named]


def _of_device(device: MesoHexapod, recordings: PaperRecordings) -> list[PrintedNumber]:
    return [
        *s0_geometry.table_1(device),
        *s0_jacobians.equation_10(device, recordings),
        *s0_jacobians.equation_14(device, recordings),
        *s0_jacobians.equation_15(device, recordings),
        *s0_jacobians.table_4(device, recordings),
    ]


def _counts(data: PaperRecordings) -> list[PrintedNumber]:
    single = sum(len(part.poses) for part in parasitic(data.commanded, data.measured))
    n = len(data.commanded)
    named = (("poses", "54", n), ("poses in one degree of freedom", "24", single), ("coupled poses", "30", n - single))
    return [s0_row(f"Section 5.1, {name}", text, "1", float(count)) for name, text, count in named]


def _statistics(data: PaperRecordings, numbers: np.ndarray) -> np.ndarray:
    """The 8 NORMS, the 10 EXTREMES and the 18 entries of Table 3, in deg and um, from printed numbers."""
    measured, kinematic = numbers.reshape(2, -1, 6)
    commanded = data.commanded / SCALE
    # The calibrated model predicts the command itself: U_j = [J^c]^-1 T_j.
    model, calibrated = pose_errors(measured, kinematic), pose_errors(measured, commanded)
    norms = [
        f(getattr(e, part))
        for part in ("rotation", "translation")
        for e in (model, calibrated)
        for f in (np.max, np.mean)
    ]
    largest, mean = np.abs(calibrated.errors).max(0), calibrated.absolute.mean
    sd = calibrated.absolute.sd
    halves = [f(v[s]) for v in (mean, largest, sd) for f, s in ((np.max, slice(0, 3)), (np.max, slice(3, 6)))]
    extremes = halves + 2 * halves[2:4]
    return np.concatenate([norms, extremes, calibrated.signed.maximum, calibrated.signed.minimum, sd])


def _section_5(data: PaperRecordings) -> list[PrintedNumber]:
    printed = np.concatenate([data.measured / SCALE, data.kinematic / SCALE]).ravel()
    ours = _statistics(data, printed)
    extra = propagated_rounding(lambda numbers: _statistics(data, numbers), printed, half_units(printed, DIGITS))
    start = len(NORMS) + len(EXTREMES)
    return [*_norms(ours[:start], extra[:start]), *_table_3(ours[start:], extra[start:])]


def _norms(ours: np.ndarray, extra: np.ndarray) -> list[PrintedNumber]:
    named = [(f"section 5.2, {name}", text, unit) for name, text, unit in NORMS] + list(EXTREMES)
    return [
        s0_row(where[0].upper() + where[1:], text, unit, ours[k], extra=extra[k], reason=ROUNDED)
        for k, (where, text, unit) in enumerate(named)
    ]


def _table_3(ours: np.ndarray, extra: np.ndarray) -> list[PrintedNumber]:
    found = []
    for k, (name, i) in enumerate((name, i) for name in TABLE_3 for i in range(6)):
        reason = ROUNDED + ("; it is that of the absolute errors" if name == "standard deviation" else "")
        found.append(
            s0_row(
                f"Table 3, {name}, {CHANNELS[i]}",
                TABLE_3[name][i],
                UNITS[i],
                ours[k],
                extra=extra[k],
                reason=reason,
            )
        )
    return found
