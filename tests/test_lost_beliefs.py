"""Every kind of state that a controller estimates, and everything that makes it wrong: told by UNSURE, with what frees it."""

from __future__ import annotations

import numpy as np
import pytest
from inertial_stages import coil, stage

import ctrlgen
from ctrlgen import ControllerStatus, build_model
from ctrlgen.controller.contraction import FOREVER
from ctrlgen.controller.estimate import EXACT, Estimator
from ctrlgen.controller.motion_estimate import MotionEstimator
from ctrlgen.controller.motion_feedforward import controller_of

H = 1e-4  # s
UNSURE, CLOCK = ControllerStatus.UNSURE, ControllerStatus.CLOCK


def heated(*effects):
    """An axis that a heater moves."""
    return ctrlgen.user_device(
        "heated",
        parameters={"k": "0.2 N/um", "f": "0.1 N/K", "tau": "5 ms", "r": "200 K/W"},
        axes={"axis": "100 um"},
        drive={"heater": "1 W"},
        state={"rise": "200 K"},
        rates=lambda u, x, p: (p.r * u.heater - x.rise) / p.tau,
        force=lambda x, p: p.f * x.rise,
        restoring_force=lambda d, p: p.k * d.axis,
        effect=effects,
    )


CREEP = {"kind": "creep", "at": "axis", "gain": "0.03", "tau": "0.2 s", "slow": "0.1"}
PLAY = {
    "kind": "displacement_hysteresis",
    "at": "axis",
    "share": "0.1",
    "reach": "10 um",
    "taper": "1",
    "reversible": "0",
}
# (device, whether no waiting frees it)
KINDS = {
    "temperature": (heated, False),
    "motion": (stage, False),
    "motion and a lag": (lambda: coil(restoring_force=lambda d, p: p.k * d.axis), False),
    "motion that stiffens": (coil, True),
    "creep": (lambda: heated(CREEP), False),
    "hysteresis": (lambda: heated(PLAY), True),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_belief_that_may_be_wrong_is_told(kind):
    make, for_ever = KINDS[kind]
    model = build_model(make())
    controller = controller_of(model, "displacement", H)
    twin = MotionEstimator(controller) if model.inertial else Estimator(controller)
    rest, m = twin.rest(), controller.kernels.nominal
    home = np.zeros(len(controller.kernels.target.channels))
    there, held = home.copy(), 0.3 * m.u_bounds[1]
    there[: len(m.axes)] = 30e-6

    # at rest, and told that it is
    step, known = twin.step_at(rest, 5, home, held)
    assert not step.status & (UNSURE | CLOCK)
    # twice: nothing is done
    twice, same = twin.step_at(known, 5, there, held)
    assert twice is None and same is known
    # reset
    assert UNSURE in twin.step(twin.forget(rest), home)[0].status
    # settled elsewhere, and on the way there
    step, _ = twin.step(rest, there, settle=True)
    assert UNSURE in step.status
    # late, by more than is followed one by one, the device held elsewhere
    step, _ = twin.step_at(known, 6 + EXACT + 1, home, held)
    assert CLOCK in step.status and UNSURE in step.status
    # freed by time, or by no time
    _, waited = twin.elapsed(twin.forget(rest), 2**31 - 1, controller.kernels.safe_drive)
    assert (UNSURE in twin.step(waited, home, settle=True)[0].status) == for_ever
    never = twin.bounds.settling if model.inertial else twin.bounds.unknown
    assert (never == FOREVER) == for_ever
