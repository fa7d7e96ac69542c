"""Paths that cannot be followed: of hexapods and the 3-RRR stage, and of stages of other kinds."""

from __future__ import annotations

import ctrlgen

BACKLASH = '\n[[effect]]\nkind = "backlash"\nat = "2X"\ngap = "0.3 um"\n'
CREEP = '\n[[effect]]\nkind = "creep"\nat = "all"\ngain = "3 %"\ntau = "0.5 s"\nslow = "30 %"\n'
ABOVE, RRR = 'centre = { delta_z = "20 um" }', 'centre = { theta_z = "-2 mrad" }'
CIRCLE, SPIRAL = 'kind = "circle"\ndiameter = "{}"\n', 'kind = "spiral"\ndiameter = "{}"\nturns = 5\n'
RASTER = 'kind = "raster"\nlength = "{}"\nspacing = "1 um"\nlines = 11\n'

# Device, effects, rate, duration, path, what is said
CASES = {
    "circle without height": ("mems_hexapod", "", 1000, 1.0, CIRCLE.format("20 um"), "only pushes"),
    "spiral without height": ("mems_hexapod", "", 1000, 1.5, SPIRAL.format("16 um"), "only pushes"),
    "raster without height": ("mems_hexapod", "", 500, 2.64, RASTER.format("10 um"), "only pushes"),
    "circle too large": ("mems_hexapod", "", 1000, 1.0, CIRCLE.format("60 um") + ABOVE, "only pushes"),
    "circle a hundred times too large": ("mems_hexapod", "", 1000, 1.0, CIRCLE.format("5 mm") + ABOVE, "only pushes"),
    "circle too fast": ("mems_hexapod", "", 1000, 0.012, CIRCLE.format("20 um") + ABOVE, "cannot cool faster"),
    "circle just too fast": ("mems_hexapod", "", 1000, 0.035, CIRCLE.format("20 um") + ABOVE, "cannot cool faster"),
    "line beyond the stroke": (
        "mems_hexapod",
        "",
        1000,
        1.0,
        'kind = "line"\nstart = { delta_z = "10 um" }\nend = { delta_z = "90 um" }',
        "stroke ends",
    ),
    "line too steep": (
        "mems_hexapod",
        "",
        1000,
        0.004,
        'kind = "line"\nstart = { delta_z = "40 um" }\nend = { delta_z = "5 um" }',
        "cannot cool faster",
    ),
    "tilt that the wires do not stand": (
        "mems_hexapod",
        "",
        200,
        0.5,
        'kind = "line"\nstart = { delta_z = "30 um" }\nend = { theta_y = "-4.1 mrad", delta_z = "30 um" }',
        "wire flexure stress",
    ),
    "lissajous without height": (
        "mems_hexapod",
        "",
        500,
        0.6,
        'kind = "lissajous"\namplitudes = ["8 um", "6 um"]\nperiods = [3, 2]',
        "only pushes",
    ),
    "upright circle": (
        "mems_hexapod",
        "",
        500,
        0.6,
        'kind = "circle"\ndiameter = "30 um"\nplane = ["delta_x", "delta_z"]\ncentre = { delta_z = "10 um" }',
        "only pushes",
    ),
    "circle with backlash": ("mems_hexapod", BACKLASH, 500, 1.0, CIRCLE.format("60 um") + ABOVE, "only pushes"),
    "circle with creep": ("mems_hexapod", CREEP, 500, 1.0, CIRCLE.format("60 um") + ABOVE, "only pushes"),
    "fast circle with creep": (
        "mems_hexapod",
        CREEP,
        1000,
        0.012,
        CIRCLE.format("20 um") + ABOVE,
        "cannot cool faster",
    ),
    "3-RRR, 5 mm": ("rrr_case2", "", 5000, 0.2, CIRCLE.format("5 mm") + RRR, "stroke ends"),
    "3-RRR, 200 um": ("rrr_case2", "", 5000, 0.1, CIRCLE.format("200 um") + RRR, "stroke ends"),
    "3-RRR, other way round": (
        "rrr_case2",
        "",
        5000,
        0.1,
        CIRCLE.format("20 um") + 'centre = { theta_z = "2 mrad" }',
        "stroke ends",
    ),
    "3-RRR without bias": ("rrr_case1", "", 5000, 0.1, CIRCLE.format("20 um"), "stroke ends"),
    "meso hexapod, 40 mm": ("meso_hexapod", "", 100, 2.0, CIRCLE.format("40 mm"), "stroke ends"),
    "meso hexapod, far line": (
        "meso_hexapod",
        "",
        100,
        2.0,
        'kind = "line"\nend = { delta_z = "9 mm" }',
        "stroke ends",
    ),
}


STAGE = {"x": "80 um", "y": "80 um"}


IN_PLANE = 'plane = ["x", "y"]\n'
LINE = 'kind = "line"\nstart = {{ {0} = "{1}" }}\nend = {{ {0} = "{2}" }}\n'


def stacks(rate=None):
    """Three stacks on two axes of 1 N/um."""
    return ctrlgen.user_device(
        "stacks",
        parameters={"g": "0.2 N/V", "k": "1 N/um"},
        axes=STAGE,
        drive_rate=None if rate is None else {"a": rate},
        drive={"a": "100 V", "b": ("0 V", "150 V"), "c": ("-20 V", "130 V")},
        restoring_force=lambda d, p: p.k * d.vector,
        force=lambda u, p: [p.g * (u.a + 0.5 * u.b), p.g * (u.c - 0.5 * u.b)],
    )


AXIS = (0.5, 30.0, 0.2e6, 10.0, 4.0)  # of flexure_axis.toml: kg, N*s/m, N/m, N/V, V
# Device, what of its file is written anew, rate, duration, path, what is said, whether an alternative can be followed
OTHERS = {
    "lever stage, 150 V do not reach": (
        "xy_lever_stage",
        (),
        2000,
        0.1,
        CIRCLE.format("90 um") + 'centre = { delta_x = "-40 um", delta_y = "-40 um" }',
        "drive of",
        None,
    ),
    "lever stage, rate of its amplifiers": (
        "xy_lever_stage",
        ('low = "0 V"\n', 'low = "0 V"\nrate = "0.5 V/ms"\n'),
        2000,
        0.1,
        CIRCLE.format("40 um") + 'centre = { delta_x = "-40 um", delta_y = "-40 um" }',
        "the path is too fast",
        None,
    ),
    "mirror without bias": (
        "tip_tilt_mirror",
        (),
        1000,
        0.2,
        CIRCLE.format("0.6 mrad") + 'plane = ["theta_x", "theta_y"]\n',
        "leg_",
        None,
    ),
    "mirror, 100 V do not reach": (
        "tip_tilt_mirror",
        (),
        1000,
        0.2,
        LINE.format("delta_z", "2 um", "25 um"),
        "amplifier output of leg",
        None,
    ),
    "axis with inertia, beyond its drive": (
        "flexure_axis",
        (),
        5000,
        0.1,
        LINE.format("axis", "0 um", "500 um"),
        "axis",
        AXIS,
    ),
    "axis with inertia, too fast": (
        "flexure_axis",
        (),
        20000,
        0.0016,
        LINE.format("axis", "0 um", "90 um"),
        "drive of axis",
        AXIS,
    ),
    "more drives than axes, too large": (stacks(), (), 1000, 0.2, CIRCLE.format("60 um") + IN_PLANE, "drive of", None),
    "more drives than axes, rate": (
        stacks("0.3 V/ms"),
        (),
        1000,
        0.3,
        CIRCLE.format("22 um") + IN_PLANE,
        "the path is too fast",
        300.0,
    ),
    "more drives than axes, rate on a line": (
        stacks("0.2 V/ms"),
        (),
        1000,
        0.25,
        'kind = "line"\nend = { x = "26 um", y = "6 um" }\n',
        "the path is too fast",
        200.0,
    ),
}
