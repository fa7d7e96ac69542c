"""S1 section 6 against the paper's finite elements: the same comparison with our independent plant, where it is installed.

`plants/` knows nothing of ctrlgen's equations; it takes the forces of ctrlgen and says what the hexapod does. It is not in a wheel.
"""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

from .row import PrintedNumber

NO_PLANT = "compares with the paper's finite elements; needs plants/, an independent model that a wheel does not carry, and exudyn"
STEP = 0.5  # um, of the stage's displacements up to 55 um, as the paper's Fig. 13 seems drawn
SECTION_6_2 = (
    ("mean error, nonlinear", "1.93"),
    ("mean error, linear", "16.19"),
    ("error at the beginning", "5.33"),
    ("abstract, mean error of the stage", "1.93"),
)
MEANS = (("delta_x", "3.94"), ("delta_y", "3.65"), ("delta_z", "2.55"))
PARASITIC = (("theta_x", "5.28e-6", "1.45e-5"), ("theta_y", "1.395e-5", "3.09e-5"), ("theta_z", "4.23e-6", "1.11e-5"))


def rows() -> list[PrintedNumber]:
    """Errors of the control model against a finer one: printed against finite elements, ours against the plant."""
    installed = find_spec("plants") is not None and find_spec("exudyn") is not None
    found = _answers() if installed else {}
    named = [(f"section 6.2, {what}", text, "%", what) for what, text in SECTION_6_2]
    named += [(f"section 6.3, mean error of {c} on the circle", text, "%", f"mean {c}") for c, text in MEANS]
    named += [(f"section 6.3, mean parasitic {c}", mean, "rad", f"parasitic {c}") for c, mean, _ in PARASITIC]
    named += [(f"section 6.3, largest parasitic {c}", most, "rad", f"largest {c}") for c, _, most in PARASITIC]
    return [
        PrintedNumber("S1", where, text, unit, *_said(found.get(key), text, unit)) for where, text, unit, key in named
    ]


def _said(ours: float | None, text: str, unit: str) -> tuple[float | None, str, float | None]:
    """Ours, why it is not the printed number, and what still counts as the same."""
    if ours is None:
        return None, NO_PLANT, None
    reason = (
        "printed against the paper's finite elements, ours against plants/: rigid parts with finite rotations on the flexures of eq. "
        "(7) and (24), whose arms stand as reconstructed for Fig. 5 and 6, which are lost. Both say how far the control model is off; "
    )
    if unit == "%":
        return ours, reason + "allowed: one percentage point, the difference of two such models", 1.0
    return ours, reason + "allowed: half of the printed rotation", 0.5 * float(text)


def _answers() -> dict[str, float]:
    from plants.cases import circle
    from plants.mems_hexapod import MemsHexapod
    from plants.numbers import read
    from plants.paper import error, linear_force, nonlinear_force
    from plants.xy_stage import Stage, actuator_stiffness

    numbers = read()
    stage, s, K_t14 = Stage(numbers), numbers.stage, float(actuator_stiffness(numbers.actuator)[0, 0])
    command = np.arange(STEP, 55.0 + STEP / 2, STEP)  # um
    of_law = {}
    for name, law in (("nonlinear", nonlinear_force), ("linear", linear_force)):
        reached = np.array([stage.displacement(state) for state in stage.path(law(command, s, K_t14))])
        of_law[name] = error(command, reached)
    case = circle(MemsHexapod())
    means, parasitic = case.mean_errors(), case.parasitic()
    off = np.abs(case.reached - case.command)
    found = {
        "mean error, nonlinear": float(of_law["nonlinear"].mean()),
        "mean error, linear": float(of_law["linear"].mean()),
        "error at the beginning": float(of_law["nonlinear"][0]),
        "abstract, mean error of the stage": float(of_law["nonlinear"].mean()),
    }
    found |= {f"mean {c}": means[c] for c, _ in MEANS}
    found |= {f"parasitic {c}": parasitic[c] for c, _, _ in PARASITIC}
    return found | {f"largest {c}": float(off[:, k].max()) for k, (c, _, _) in enumerate(PARASITIC)}
