"""A controller whose kernels answer from a script, and devices whose limits take every branch of the limiter."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen import Controller
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.controller.named_inverse import NamedInverses
from ctrlgen.devices import Limit
from ctrlgen.model.inverse import NEWTON_STEPS, Inverse

N = 3  # axes; enough for "some of them, not the first"
SLACK = 2.0**-6  # coarse, so that values within it are common; a power of two keeps the arithmetic exact
Z_LOW, Z_HIGH = np.array([-1.0, 0.0, -0.5]), np.array([1.0, 2.0, 0.5])
S_LOW, S_HIGH = np.full(N, 0.0), np.full(N, 1.0)
U_LOW, U_HIGH = np.full(N, 0.0), np.full(N, 1.0)
FALL, RISE = np.array([-0.25, -0.125, -np.inf]), np.array([0.125, 0.25, np.inf])  # of the drives, in one sample
TARGET_LIMIT = np.full(N, 64.0)
NO_DRIVE = 2.0  # of the first displacement: within what a state may be, beyond what a sample leads to
OUTCOMES = ("inside", "edge", "beyond")
TRIALS = tuple("".join(outcome) for outcome in product("+-", repeat=3))  # "+": the drives of a trial are admissible
REACHED = ("into inside", "into edge", "into beyond")  # the drives of what is reached in closed form
PLAIN = ("inside", "inside", "kept", "inside")
# instead of a scenario: of it the controller's C says the device
NOWHERE = SimpleNamespace(device_sha256="0" * 64, device=SimpleNamespace(load_texts=()))
PATIENCE = 3000  # samples drawn for one combination; the rarest sequence of trials is one in some hundreds


@dataclass(frozen=True)
class Device:
    """Which parts the limiter has: each is a switch of the C template."""

    states: bool = True  # actuators with a state of their own
    limited: bool = True  # whose limits a displacement in its range can break
    memory: bool = False  # effects that remember: x is longer than the actuators' states
    composite: str = "bounded"  # "none"; "plain": the ratio is always worked out; "bounded": a cheap bound comes first
    rounds: int = 1  # how often a displacement that breaks a composite limit is shrunk
    moving: bool = True  # a sample time: step beside settle
    coupled: bool = True  # one displacement moves several channels
    rated: bool = False  # drives change no faster than they may
    own: bool = False  # each drive leads one displacement: what is reached is known in closed form

    def __str__(self) -> str:
        return (
            "-".join(
                f"{name}_{value}"
                for name, value in vars(self).items()
                if value != type(self).__dataclass_fields__[name].default
            )
            or "all"
        )

    @property
    def n_s(self) -> int:
        return N if self.states else 0

    @property
    def n_x(self) -> int:
        return self.n_s + (2 if self.memory else 0)

    def combinations(self) -> set[tuple[str, ...]]:
        """Every combination of decisions that this device can be brought to."""
        state = OUTCOMES if self.states and self.limited else ("inside",)
        shares = {"none": ("none",), "plain": ("kept", "edge", "over"), "bounded": ("bound", "kept", "edge", "over")}
        drive = ("inside", "edge", *(REACHED if self.own else ("origin", *TRIALS)))
        modes = ("settle", "step") if self.moving else ("settle",)
        return set(product(modes, OUTCOMES, state, shares[self.composite], drive))


DEVICES = (
    Device(),
    Device(memory=True, composite="plain", rounds=3),
    Device(limited=False, rounds=3),
    Device(limited=False, memory=True, composite="none"),
    Device(states=False, memory=True),
    Device(states=False, moving=False, composite="plain"),
    Device(moving=False, composite="none", coupled=False),
    Device(composite="none", rated=True),
    Device(composite="none", own=True),
    Device(states=False, memory=True, composite="plain", rounds=3, rated=True),
)


@dataclass(frozen=True, eq=False)
class Scripted(ControllerKernels):
    """Kernels and limits that are given, in place of those of a model."""

    nominal: Any = None
    static: Any = None
    moving: Any = None
    named: Any = None
    newton_steps: Any = NEWTON_STEPS
    input_limits: Any = None
    safe_drive: Any = None
    guarded_limits: Any = None
    composite_shares: Any = None
    composite_bound: Any = None
    target_bound: Any = None
    target_directions: Any = None
    quick: Any = None
    few_shares: Any = None
    own_drives: Any = False
    composite_rounds: Any = None
    nearest_slopes: Any = None
    contraction: Any = None
    has_state_limits: bool = True

    def slacks(self, share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        # in double the C has the slack of the controller
        assert share == SLACK
        return np.full(N, SLACK), np.full(self.nominal.n_states, SLACK), np.full(N, SLACK)

    def state_can_be_limited(self, share: float) -> bool:
        return self.has_state_limits

    def drive_can_be_limited(self, share: float) -> tuple[bool, bool]:
        return True, True


def scripted(device: Device) -> Controller:
    x, z, target, wanted, u = (
        ca.SX.sym(name, count)
        for name, count in (("x", device.n_x), ("z", N), ("target", N), ("wanted", N), ("drive", N))
    )
    state = ca.SX.sym("state", device.n_s)

    def kernel(name, arguments, names, result):
        return ca.Function(name, arguments, [result], names, ["result"])

    step = (ca.sum1(x) / 16 if device.n_x else 0) + u / 4 - z / 2
    newton = kernel("newton", [x, z, u], ["x", "z", "drive"], z + step / 32)
    settled = z
    for _ in range(NEWTON_STEPS):
        settled = newton(x, settled, u)
    settle = kernel("settle", [x, z, u], ["x", "z", "drive"], settled)
    ratio = ca.fabs(z[1]) + ca.fabs(z[0] * (1 - wanted[0]))

    def inverse(own: float) -> Inverse:
        """`own` differs between equilibrium and next sample, so that taking the other's kernel shows."""
        phase = 5 * wanted + (state if device.states else 0) + 61 * z[1] * np.arange(1, N + 1) + own
        # Beyond NO_DRIVE no drive is a number, as where a root has none.
        drive = 0.5 + z[2] * (phase - ca.floor(phase) - 0.5) + ca.floor(ca.sqrt(NO_DRIVE**2 - z[0] ** 2) / 8)
        return Inverse(
            kernel("displacement", [x, z, target], ["x", "z", "target"], target + own * z),
            kernel("state", [x, z, wanted], ["x", "z", "wanted"], x[: device.n_s] + 2**-8 * wanted[: device.n_s]),
            kernel("drive", [x, z, wanted, state], ["x", "z", "wanted", "state"], drive),
            kernel("memory", [x, z, wanted], ["x", "z", "wanted"], x[device.n_s :]),
            kernel("advance", [x, z, u], ["x", "z", "drive"], (1 - own) * x / 2 + ca.sum1(z) / 8 + u[0] / 4),
            settle,
            newton,
        )

    signal = SimpleNamespace(channels=("a", "b", "c"), units=("m",) * N, label="signal", scale=(1.0,) * N)
    nominal = SimpleNamespace(
        axes=("a", "b", "c"),
        x=x,
        z=z,
        n_states=device.n_s,
        rest=np.full(device.n_x, 0.5),
        limits=(),
        laws=(),
        rate_limits=(Limit("rate", "rate", ("a",), "m/s", u[0]),) * device.rated,
        rate_bounds=(FALL / 1e-3, RISE / 1e-3),
        z_bounds=(Z_LOW, Z_HIGH),
        u_bounds=(U_LOW, U_HIGH),
        probability=None,
        x_bounds=(
            np.r_[S_LOW[: device.n_s], [-np.inf] * 2 * device.memory],
            np.r_[S_HIGH[: device.n_s], [np.inf] * 2 * device.memory],
        ),
        x_names=tuple(f"x{i}" for i in range(device.n_x)),
        x_units=("K",) * device.n_x,
        signals={"drive": signal, "displacement": signal, "state": signal if device.states else None},
        redundant=False,
        device=SimpleNamespace(
            name="scripted", title="scripted", source="none", given_at_start=(), run_time=None, load_texts=()
        ),
    )
    guarded, moving = device.composite != "none", inverse(0.25) if device.moving else None
    kernels = Scripted(
        nominal,
        "displacement",
        1e-3 if device.moving else None,
        nominal=nominal,
        static=inverse(0.0),
        moving=moving,
        named=NamedInverses(inverse(0.0), moving, SimpleNamespace(laws=()), []),
        input_limits=TARGET_LIMIT,
        safe_drive=np.zeros(N),
        guarded_limits=(SimpleNamespace(label="share"),) if guarded else (),
        composite_shares=kernel("shares", [x, z, wanted], ["x", "z", "wanted"], ratio**2),
        composite_bound=kernel("bounded", [wanted], ["wanted"], 2 - wanted[1])
        if device.composite == "bounded"
        else None,
        composite_rounds=device.rounds,
        own_drives=device.own,
        nearest_slopes=np.array([[1, 0.25, 0.0625], [0.25, 1, -0.125], [0.0625, -0.125, 1]])
        if device.coupled
        else None,
        has_state_limits=device.states and device.limited,
    )
    controller = Controller(kernels, SLACK)
    assert device.rated == (controller.rate is not None)
    assert kernels.examined_first == (device.memory, device.memory or device.moving)
    return controller


def outcome(value: np.ndarray, low: np.ndarray, high: np.ndarray) -> str:
    """Whether a value is inside its range, within the slack of it, or beyond."""
    excess = np.max(np.maximum(low - value, value - high))
    return "inside" if excess <= 0 else "edge" if excess <= SLACK else "beyond"


def drives(calls: list) -> list[str]:
    """Outcomes of the drives worked out: at the target, and if they are beyond, at the origin and in the trials."""
    return [outcome(value, U_LOW, U_HIGH) for name, value in calls if name == "drive"]


def grows(calls: list) -> bool:
    """Whether a composite limit is broken within the slack at first and by more in a later round."""
    ratios = [value[0] for name, value in calls if name == "composite_ratio"]
    return bool(ratios) and 1 < ratios[0] <= 1 + SLACK < max(ratios)


def combination(device: Device, mode: str, calls: list) -> tuple[str, ...]:
    """The decisions that kernels' answers called for. Written from the meaning of the limits, not from the limiter."""
    first = {name: value for name, value in reversed(calls)}
    outcomes = drives(calls)
    state = outcome(first["state"], S_LOW, S_HIGH) if device.states else "inside"
    share = "none"
    if device.composite != "none":
        if device.composite == "bounded" and first["composite_bound"][0] <= 1:
            share = "bound"
        else:
            ratio = first["composite_ratio"][0]
            share = "kept" if ratio <= 1 else "edge" if ratio <= 1 + SLACK else "over"
    drive = outcomes[0]
    if drive == "beyond":
        if device.own:
            return mode, outcome(first["displacement"], Z_LOW, Z_HIGH), state, share, f"into {outcomes[1]}"
        drive = "origin" if outcomes[1] == "beyond" else "".join("-" if o == "beyond" else "+" for o in outcomes[2:])
    return mode, outcome(first["displacement"], Z_LOW, Z_HIGH), state, share, drive


def sample(
    rng: np.random.Generator, device: Device, wish: tuple[str, ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(x, z, target) that bring the decisions `wish` about with a fair chance."""
    mode, displacement, state, share, drive = wish
    middle, half = (Z_LOW + Z_HIGH) / 2, (Z_HIGH - Z_LOW) / 2
    wanted = middle + 0.9 * half * rng.uniform(-1, 1, N)
    if share == "bound":  # the cheap bound is below one for a high second displacement
        wanted[1] = rng.uniform(1.5, 1.9)
    elif device.composite == "bounded":
        wanted[1] = rng.uniform(0.1, 0.9)
    out = (SLACK if displacement == "edge" else 1.0) * rng.uniform(0.1, 0.9, N) * (displacement != "inside")
    some = rng.permutation(N) < rng.integers(1, N + 1)
    wanted = np.where(some & (out > 0), middle + np.where(wanted > middle, 1, -1) * (half + out), wanted)
    z = np.array([rng.choice([0.0, 0.3]), 0.0, 0.0])
    over = {"bound": rng.uniform(0, 2), "kept": rng.uniform(0, 0.6), "edge": 1 + SLACK * rng.uniform(0.1, 0.9)}
    z[1] = over.get(share, rng.uniform(1.1, 1.5)) - (abs(z[0] * (1 - wanted[0])) if share == "edge" else 0)
    z[2] = {"inside": rng.uniform(0.1, 0.99), "edge": 1 + 2 * SLACK * rng.uniform(0.5, 1)}.get(
        drive, rng.uniform(1.1, 1.6)
    )
    x = rng.uniform(0.2, 0.8, device.n_x)
    if state != "inside":
        off = SLACK / 2 if state == "edge" else rng.uniform(0.1, 1, N)
        some = rng.permutation(N) < rng.integers(1, N + 1)
        x[:N] = np.where(some, np.where(rng.random(N) < 0.5, -off, 1 + off), x[:N])
    return x, z, wanted - (0.25 if mode == "step" else 0.0) * z


def last_drive(rng: np.random.Generator, controller: Controller, case: tuple) -> list[np.ndarray]:
    """Drives before a case (mode, x, z, target) from which it asks for changes within rates, within their slack, or beyond."""
    if controller.rate is None:
        return []
    mode, x, z, target = case
    unrated = replace(controller, keeps_rates=False)
    wanted = unrated.step((x, z), target, settle=mode == "settle").drive
    fall, rise = np.maximum(FALL, -1.0), np.minimum(RISE, 1.0)
    change = np.array([rng.uniform(fall, rise), rng.uniform(-1, 1, N)][int(rng.integers(2))])
    if rng.integers(3) == 0:  # within the slack
        i = int(rng.integers(2))
        change[i] = rng.choice([RISE[i] + SLACK / 2, FALL[i] - SLACK / 2])
    return [np.clip(wanted - change, U_LOW, U_HIGH)]


def odd_cases(rng: np.random.Generator, device: Device) -> list[tuple[str, np.ndarray, np.ndarray, np.ndarray]]:
    """Targets that are no command, and states that nothing but a defect could leave."""
    cases = []
    for mode in ("settle", "step") if device.moving else ("settle",):
        for _ in range(300 if device.own else 0):  # of which some lead away from the target, whatever the drives
            cases.append((mode, *sample(rng, device, (mode, *PLAIN[:-1], REACHED[0]))))
        for bad in (np.nan, np.inf, -np.inf, 65.0, -65.0, 64.0, -64.0):
            for i in range(N):
                x, z, target = sample(rng, device, (mode, *PLAIN))
                target[i] = bad
                cases.append((mode, x, z, target))
                x, z, target = sample(rng, device, (mode, *PLAIN))
                z[i] = bad
                cases.append((mode, x, z, target))
        for i, bad in product(range(device.n_x), (np.nan, np.inf, -np.inf)):
            x, z, target = sample(rng, device, (mode, *PLAIN))
            x[i] = bad
            cases.append((mode, x, z, target))
        x, z, target = sample(rng, device, (mode, *PLAIN))
        target[0] -= 0.25 * (3 - z[0]) if mode == "step" else 0
        z[0] = 3
        cases.append((mode, x, z, target))
        x, z, target = sample(rng, device, (mode, *PLAIN))
        cases.append((mode, np.full_like(x, np.nan), np.full_like(z, np.nan), target))  # in C: never initialised
        for i, drive, command in product(range(device.n_x + N), ("edge", "origin"), (None, np.nan, 1.0)):  # absurd
            x, z, target = sample(rng, device, (mode, *PLAIN[:-1], drive))
            wanted = target + (0.25 * z if mode == "step" else 0)
            (x if i < device.n_x else z)[i if i < device.n_x else i - device.n_x] = -(2.0**60)
            target = wanted - (0.25 * z if mode == "step" else 0)
            target[0] = target[0] if command is None else command * 10  # within its range, no command, beyond
            cases.append((mode, x, z, target))
    return cases


def spoilt_drives(rng: np.random.Generator, device: Device) -> list[tuple]:
    """Cases whose last drive no controller left."""
    cases = []
    for mode, i, bad in product(("settle", "step"), range(N), (np.nan, np.inf, -np.inf, 2.0**60)):
        for drive in ("inside", "edge", "origin"):
            last = np.full(N, 0.5)
            last[i] = bad
            cases.append((mode, *sample(rng, device, (mode, *PLAIN[:-1], drive)), last))
    return cases
