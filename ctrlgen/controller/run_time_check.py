"""Whether everything that is compiled into a controller holds for all values of its run-time constants.

What is neither a formula of the constants nor the same at all the values of `ctrlgen.controller.run_time_choices.choices` is refused.
"""

from __future__ import annotations

from dataclasses import fields
from functools import lru_cache

import casadi as ca
import numpy as np

from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.controller.named_inverse import NamedInverses
from ctrlgen.controller.run_time_choices import choices
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.model.inverse import Inverse

POINTS = 12  # at which kernels are compared
SAME = 1e-7  # relative difference of numbers computed in two orders; a constant that acts moves them by far more
# What the kernels compute, for the one who named a constant that acts on them.
WORDS = {
    "displacement": "the way from the target to the displacement",
    "state": "the actuators' states",
    "drive": "the drives",
    "memory": "the memories of effects",
    "advance": "the states at the next sample",
    "newton": "the balance of forces",
}


def check_run_time(kernels: ControllerKernels) -> None:
    """Raises InputError for a run-time constant that acts on something which cannot follow it when the C runs."""
    device, model = kernels.model.device, kernels.nominal
    if not device.given_at_start:
        return
    if model.inertial:
        what = "holds for a stage without inertia; leave [run_time] out, and generate the C anew with a calibrated device file"
        raise InputError(device.name, [Fault("run_time", what)])
    if faults := _faults(kernels):
        raise InputError(device.name, faults)


@lru_cache(maxsize=4)  # float and double ask for the same
def _faults(kernels: ControllerKernels) -> tuple[Fault, ...]:
    """The constants that act on something compiled in."""
    device, faults = kernels.model.device, dict[str, str]()
    for values, variant in zip(choices(device.given_at_start), kernels.variants, strict=True):
        if any(path in faults for path in values):
            continue
        if acted := _compiled_in(kernels, variant, values):
            word = "acts" if len(values) == 1 else "together act"
            faults |= {", ".join(values): f"{word} on {acted}, which is compiled in: leave it out of [run_time]"}
    return tuple(Fault(f"run_time.constants {path}", what) for path, what in faults.items())


def _compiled_in(kernels: ControllerKernels, variant: ControllerKernels, values: dict[str, float]) -> str:
    """What of `kernels` does not become that of its `variant` when the constants take `values`; empty where all does."""
    m, other, named = kernels.nominal, variant.nominal, kernels.given
    assert named is not None  # a device without run-time constants has no variants
    p = np.array([values.get(path, number) for number, path in named.numbers])
    for what, symbol, bounds in (("states", m.x, other.x_bounds), ("drives", m.u, other.u_bounds)):
        given = {"states": named.model.x, "drives": named.model.u}[what]
        formulas = ca.Function("bounds", [named.model.p], list(named.model.bounds_formula(given)))(p)
        if symbol.numel() and not all(_same(f.full().ravel(), b) for f, b in zip(formulas, bounds, strict=True)):
            return f"the limits of the {what}"
    if not all(_same(a, b) for a, b in zip(m.z_bounds, other.z_bounds, strict=True)):
        return "the displacement range"
    rest = ca.Function("rest", [named.model.p], [named.model.rest_formula])(p).full().ravel()
    if not _same(rest, other.rest):
        return "the state at rest"
    if not _same(kernels.safe_drive, variant.safe_drive):
        return "the drive without a target"
    P, other_P = kernels.nearest_slopes, variant.nearest_slopes
    if (P is None) != (other_P is None) or (P is not None and other_P is not None and not _same(P, other_P)):
        return "the target nearest to one out of range"
    return _kernels_differ(kernels, variant, named, p)


def _kernels_differ(kernels: ControllerKernels, variant: ControllerKernels, named: NamedInverses, p: np.ndarray) -> str:
    m, other = kernels.nominal, variant.nominal
    rng = np.random.default_rng(1)
    x_low, x_high = (
        np.where(np.isfinite(b), b, side * m.x_scale) for b, side in zip(other.x_bounds, (-1, 1), strict=True)
    )
    z = rng.uniform(*m.z_bounds, (POINTS, len(m.axes))).T
    x = rng.uniform(x_low, x_high, (POINTS, len(x_low))).T
    u = rng.uniform(*other.u_bounds, (POINTS, m.u.numel())).T
    followed = ca.Function("followed", [other.x, other.z, other.u], [other.signals[kernels.follow].expr])
    at = {
        "x": x,
        "z": z,
        "wanted": z[:, ::-1],
        "state": x[: m.n_states, ::-1],
        "drive": u,
        "target": followed.map(POINTS)(x, z, u).full(),
    }
    pairs = [(named.static, variant.static)]
    if named.moving is not None and variant.moving is not None:
        pairs.append((named.moving, variant.moving))
    for formulas, inverse in pairs:
        for name in (f.name for f in fields(Inverse) if f.name in WORDS):
            wanted, given = getattr(inverse, name), getattr(formulas, name)
            if wanted.numel_out(0):
                arguments = [at[a] for a in wanted.name_in()]
                followed_p = given.map(POINTS)(*arguments, np.tile(p[:, None], (1, POINTS))).full()
                values = wanted.map(POINTS)(*arguments).full()
                # a drive that cannot be had says only on which side of the limits it is
                if name == "drive":
                    low, high = (bound[:, None] for bound in other.u_bounds)
                    followed_p, values = np.clip(followed_p, low, high), np.clip(values, low, high)
                if not _same(followed_p, values):
                    return WORDS[name]
    counts = [len(c.guarded_limits) for c in (kernels, variant)]
    if counts[0] != counts[1]:
        return "which limits can be met"
    if counts[0]:
        limited = [c.composite_shares.map(POINTS)(x, z, at["wanted"]).full() for c in (kernels, variant)]
        if not _same(*limited):
            return "limits on stress or rotation"
        cheap = [c.composite_bound for c in (kernels, variant)]
        if (cheap[0] is None) != (cheap[1] is None) or (
            cheap[0] is not None and cheap[1] is not None and not _same(*(f.map(POINTS)(z).full() for f in cheap if f))
        ):
            return "limits on stress or rotation"
    return ""


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two arrays hold the same numbers, infinite ones and NaN too, to `SAME` of the largest."""
    finite = np.isfinite(b)
    size = float(np.max(np.abs(b[finite]), initial=0.0))
    near = np.allclose(a[finite], b[finite], rtol=0, atol=SAME * size)
    return bool(near and np.array_equal(a[~finite], b[~finite], equal_nan=True))
