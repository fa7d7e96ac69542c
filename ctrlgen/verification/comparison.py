"""Compares the generated C with the model: builds it strictly, runs it, reports where it first differs.

Every compiler present builds every arithmetic. Three references: the controller evaluated by CasADi
(`ctrlgen.controller.feedforward`), IPOPT's solution of the scenario, and the model simulated forward with the
drives that the C computed.
"""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from ctrlgen.controller.feedforward import SECANT_FRACTION, ControllerStatus
from ctrlgen.controller.motion_feedforward import MotionKernels
from ctrlgen.core.units import from_si, same_dimension
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.toolchains import COMPILERS, find_compilers
from ctrlgen.firmware.folder import CFolder, write_harness
from ctrlgen.firmware.online.online import FLOAT_SLACK
from ctrlgen.firmware.player.compression import Compression
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import simulate, trace
from ctrlgen.numerics.newton import newton_solver
from ctrlgen.trajectory.playback import ANGLE_TOLERANCE, LENGTH_TOLERANCE
from ctrlgen.trajectory.solution import Solution
from ctrlgen.verification.host import build_host, run_host
from ctrlgen.verification.reference import ReferenceAnswers
from ctrlgen.verification.tracking import reached

# What a difference may be, and why.
LENGTH_LIMIT = {
    Real.DOUBLE: 1e-11,
    Real.FLOAT: 1e-10,
}  # m: 0.01 nm, 0.1 nm: below the resolution of every sensor in the shipped devices
ANGLE_LIMIT = {Real.DOUBLE: 1e-12, Real.FLOAT: 1e-8}  # rad: 1e-8 rad moves the platform's rim by 0.02 nm
RELATIVE_LIMIT = 1e-12  # double C against CasADi: about 4500 roundings
EXCESS_LIMIT = {Real.DOUBLE: 1e-9, Real.FLOAT: 1e-5}  # of a limit's bound: rounding
EXCESS_LIMIT_WITH_MEMORY = (
    1e-3  # the same where effects remember: while the drives are limited a memory moves on under the displacement
)
ROUNDINGS = 16  # float C against CasADi: of the largest value, accumulated over one evaluation


@dataclass(frozen=True)
class ComparisonRow:
    """One comparison of one signal. `worst`, `rms`, `limit` in `unit`; `first` the first sample beyond the limit, or None."""

    build: str
    what: str
    signal: str
    unit: str
    worst: float
    rms: float
    limit: float
    samples: int
    first: int | None

    @property
    def passed(self) -> bool:
        """Whether every sample is within the limit; NaN is not."""
        return self.first is None


@dataclass(frozen=True)
class Comparison:
    """All rows; `compilers`: name -> version line; `missing`: compilers that were not found."""

    rows: tuple[ComparisonRow, ...]
    compilers: dict[str, str]
    missing: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether something ran and everything that ran is within its limit."""
        return bool(self.rows) and all(row.passed for row in self.rows)


def compare(
    folder: CFolder,
    solution: Solution,
    progress: Callable[[str], None] = lambda _: None,
    reference: ReferenceAnswers | None = None,
) -> Comparison:
    """Builds and runs `folder` with every compiler found; `reference`: where it was computed before.

    Raises ToolError when a build or a run fails.
    """
    compilers = find_compilers()
    builds = [(compiler, real) for compiler in compilers for real in Real]
    with tempfile.TemporaryDirectory(prefix="ctrlgen-") as scratch, ThreadPoolExecutor(max_workers=2) as pool:
        for real in Real:
            write_harness(folder, solution.scenario, solution.model, real, Path(scratch) / f"harness_{real.suffix}.c")
        programs = [pool.submit(build_host, compiler, real, folder, Path(scratch)) for compiler, real in builds]
        reference = reference or ReferenceAnswers(solution)  # while the compilers work
        rows: list[ComparisonRow] = []
        for (compiler, real), program in zip(builds, programs, strict=True):
            rows += _rows(f"{compiler} {real.value}", real, program.result(), reference, folder.compression.get(real))
            progress(f"{compiler} {real.value}")
    return Comparison(tuple(rows), compilers, tuple(c for c in COMPILERS if c not in compilers))


def _rows(
    build: str, real: Real, program: Path, ref: ReferenceAnswers, compression: Compression | None
) -> list[ComparisonRow]:
    """All comparisons of one build."""
    m, n = ref.model, ref.model.u.numel()
    at_states = 1 + n + len(m.axes)
    signals = [("drive", slice(1, 1 + n)), ("displacement", slice(1 + n, at_states))]
    width = at_states - 1 + m.n_states
    if m.n_states:
        signals.append(("state", slice(at_states, 1 + width)))
    rows = []

    def add(what: str, role: str, difference: np.ndarray, limit: float, channels: slice = slice(None)) -> None:
        signal = m.signals[role]
        unit = signal.units[channels][0]
        unit = {"um": "nm", "degC": "K", "urad": "rad"}.get(unit, unit)
        rows.append(_row(build, what, signal.label, unit, np.asarray(difference)[:, channels], limit))

    left = (1 - SECANT_FRACTION) ** 2  # of the range: what the third trial of the line search can still change
    states = (m.x_bounds[0][: m.n_states], m.x_bounds[1][: m.n_states])
    ties_of = {
        role: left * float(np.max(high - low, initial=0.0))
        for role, (low, high) in {"displacement": m.z_bounds, "state": states, "drive": m.u_bounds}.items()
    }

    def strict(role: str, size: float, wider: float) -> float:
        if real is Real.DOUBLE:
            return RELATIVE_LIMIT * size
        limit = _float_limit(m, role, size, ref)
        return wider * (max(limit, LENGTH_LIMIT[real]) if role == "displacement" else limit)

    def against_casadi(
        what: str, answer: np.ndarray, reference: np.ndarray, wider: float = 1.0, ties: bool = False
    ) -> None:
        """`ties`: a drive within rounding of limit plus slack may count as admissible in one and not in the other. Where the first
        difference is at such a sample, all may differ by what the last trial of the line search changes."""
        status, expected = answer[:, 0].astype(int), reference[:, 0].astype(int)
        # the slack in float is wider: what is within it is RATE in double alone
        if real is Real.FLOAT and ref.controller.rate is not None:
            slack = ref.controller.kernels.slacks(FLOAT_SLACK)[2]
            same = np.all(np.abs(answer[:, signals[0][1]] - reference[:, signals[0][1]]) <= slack, axis=1)
            status, expected = (np.where(same, s & ~ControllerStatus.RATE, s) for s in (status, expected))
        rows.append(_row(build, what, "status", "1", (status - expected)[:, None], 0.0))
        if real is Real.FLOAT:  # in float the line search may accept another trial, an equally good answer
            plain = (reference[:, 0].astype(int) & ControllerStatus.DRIVE) == 0
            answer, reference = answer[plain], reference[plain]
        off = {role: answer[:, columns] - reference[:, columns] for role, columns in signals}
        sizes = {role: np.abs(reference[:, columns]).max() or m.signals[role].scale[0] for role, columns in signals}
        limits = {role: strict(role, size, wider) for role, size in sizes.items()}
        differs = np.any([np.abs(off[role]).max(axis=1) > limit for role, limit in limits.items()], axis=0)
        if ties and differs.any() and int(reference[np.argmax(differs), 0]) & ControllerStatus.DRIVE:
            limits = {role: max(limit, ties_of[role]) for role, limit in limits.items()}
        for role, limit in limits.items():
            add(what, role, off[role], limit)

    moving = ref.scenario.sample_time is not None
    followed = (
        run_host(program, "follow", ref.command, width, ref.start)
        if moving
        else run_host(program, "settle", ref.command, width)
    )
    against_casadi("scenario, online C - CasADi", followed, ref.followed)
    settled = run_host(program, "settle", ref.random, width)
    # Far targets are large numbers that cancel in the displacement: the limit follows their roundings.
    far = ref.cancelling / np.abs(m.z_bounds).max()
    against_casadi("random targets, online C - CasADi", settled, ref.settled, max(1.0, float(far)))
    rows.append(_shipped_test(build, program))
    for unit, limit in (("rad", ANGLE_LIMIT[real]), ("um", LENGTH_LIMIT[real])):
        channels = [i for i, u in enumerate(m.signals[ref.scenario.file.follow].units) if same_dimension(u, unit)]
        plain = np.flatnonzero(ref.settled[: len(ref.random) // 2, 0] == 0)
        if channels and plain.size:
            at_rest = _equilibria(ref, settled[plain])
            span = slice(channels[0], channels[-1] + 1)
            if (
                unit == "rad" and real is Real.FLOAT
            ):  # an axis that turns by degrees has more to round than a platform's tilt
                limit = max(
                    limit, ROUNDINGS * float(np.finfo(np.float32).eps) * np.abs(ref.positions[plain][:, span]).max()
                )
            add(
                "random targets, online C -> model - target",
                ref.scenario.file.follow,
                at_rest - ref.positions[plain],
                limit,
                span,
            )
    if moving:
        cold = ref.controller.rest()
        chased = run_host(program, "follow", ref.hostile, width, cold)
        if real is Real.DOUBLE:  # in float the line searches accept other trials, and the states drift apart
            against_casadi("hostile sequence, online C - CasADi", chased, ref.chased, ties=True)
        if not m.inertial:  # where jumping targets take a mass, no drive can decide any more
            what = "hostile sequence -> model: excess over a limit"
            allowed = EXCESS_LIMIT[real] if m.x.numel() == m.n_states else EXCESS_LIMIT_WITH_MEMORY
            excess = _excess(m, chased[:, 1 : 1 + n], ref.sample_time, cold[0])
            excess[1:][_told(chased[:, 0])] = 0.0
            rows.append(_row(build, what, "share of its bound", "1", excess, allowed))
        if ref.controller.rate is not None:
            what, rate = "hostile sequence: change of a drive over its rate", ref.controller.rate
            change = np.diff(np.vstack([cold[2], chased[:, 1 : 1 + n]]), axis=0)
            over = np.maximum(np.maximum(change - rate.rise, rate.fall - change), 0.0) / m.u_scale
            rows.append(_row(build, what, "share of its size", "1", over, EXCESS_LIMIT[real]))

    solved, online = ref.solution.drive, followed[:, 1 : 1 + n]
    # with inertia the solved drives make up for being held, which those of the online C do not
    if not m.inertial and not (m.redundant and _rates_act(ref)):
        # ten times IPOPT's own tolerance; that of the least effort is one of the effort, which hardly changes near its least and at a limit
        limit = (1e-5 if m.redundant else 1e-8) * m.u_scale.max()
        if real is Real.FLOAT:
            limit = max(limit, _float_limit(m, "drive", np.abs(solved).max(), ref))
        add("scenario, online C - IPOPT", "drive", online - solved, limit)

    role = ref.scenario.file.follow
    for what, drives in _drive_sets(program, ref, online):
        off = reached(ref, drives, followed) - ref.path
        angle, length = (
            (max(ANGLE_LIMIT[real], ref.held_error), max(LENGTH_LIMIT[real], ref.held_error))
            if what == "online C"
            else (ANGLE_TOLERANCE, LENGTH_TOLERANCE)
        )
        for unit, limit in (("rad", angle), ("um", length)):
            channels = [i for i, u in enumerate(m.signals[role].units) if same_dimension(u, unit)]
            if channels:
                add(f"{what} -> model - command", role, off, limit, slice(channels[0], channels[-1] + 1))
    if compression is not None:
        # against the curve evaluated by NumPy: its roundings, for a compiler that fuses a product and a sum
        near = ROUNDINGS * float(np.finfo(np.float32 if real is Real.FLOAT else float).eps) * np.abs(solved).max()
        k = np.arange(len(solved))
        played = run_host(program, "sample", k, n)[:, 1:]
        add("player C - its curve", "drive", played - compression.drives(k), near)
        add(f"player C - {ref.solution.solver}", "drive", played - solved, (compression.chosen.drive or 0.0) + near)
        times = (k[:-1] + 0.75) * ref.sample_time  # a quarter of the way from middle to middle
        quarter = run_host(program, "at", times, n)[:, 1:] - compression.drives(k[:-1], np.full(len(k) - 1, 0.25))
        # the time itself is rounded: that much of the steepest change from sample to sample
        steep = 4 * float(np.finfo(np.float32 if real is Real.FLOAT else float).eps) * 2 * len(k)
        add("player C a quarter on - its curve", "drive", quarter, near + steep * np.abs(np.diff(solved, axis=0)).max())
    return rows


def _shipped_test(build: str, program: Path) -> ComparisonRow:
    """The self test that the package contains: 0 when it passes."""
    done = subprocess.run([f"{program}_test"], capture_output=True, text=True, check=False, start_new_session=True)
    failed = float(done.returncode != 0)
    return ComparisonRow(
        build, "the folder's own test", "vectors", "1", failed, failed, 0.0, 1, None if done.returncode == 0 else 0
    )


def _equilibria(ref: ReferenceAnswers, answers: np.ndarray) -> np.ndarray:
    """(n, channels): the model's equilibria under constant drives, by simulation, not by the inverse."""
    m = ref.model
    n = m.u.numel()
    drives = answers[:, 1 : 1 + n]
    x, z, u = (ca.MX.sym(name, s.numel()) for name, s in (("x", m.x), ("z", m.z), ("u", m.u)))
    both = ca.Function("at_rest", [m.x, m.z, m.u, m.p], [m.settling, m.balance])
    dynamics = both(x, z, u, m.p_nominal)
    scale = np.concatenate([m.x_scale, m.z_scale])
    scaled = ca.vertcat(dynamics[0] / m.x_scale, dynamics[1] / m.force_scale)
    w = ca.MX.sym("w", len(scale))
    states, places = ca.vertsplit(w, [0, len(m.rest), len(scale)])
    at = ca.substitute([scaled], [x, z], [states * m.x_scale + m.rest, places * m.z_scale])[0]
    newton = newton_solver("rest", at, w, u, step_below=1e-12, most_steps=60)
    start = np.ones((len(drives), len(scale)))
    if m.inertial:  # several displacements may balance one force, as of a pendulum: the one meant
        start[:, len(m.rest) :] = answers[:, 1 + n : 1 + n + len(m.axes)] / m.z_scale
    roots = newton.map(len(drives))(start.T, drives.T).full().T
    states, displacements = roots[:, : len(m.rest)] * m.x_scale + m.rest, roots[:, len(m.rest) :] * m.z_scale
    return trace(m, np.zeros(len(drives)), states, displacements, drives).signals[ref.scenario.file.follow]


def _drive_sets(program: Path, ref: ReferenceAnswers, online: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Drives to send through the model: those of the online C, and the player's."""
    sets = [("online C", online)]
    if ref.scenario.sample_time:
        sets.append(
            ("player C", run_host(program, "sample", np.arange(len(ref.solution.drive)), online.shape[1])[:, 1:])
        )
    return sets


def _rates_act(ref: ReferenceAnswers) -> bool:
    """Whether a rate is met in the solution: the solver then chooses among more drives than axes with the whole path in view."""
    if (rate := ref.controller.rate) is None:
        return False
    change = np.diff(np.vstack([ref.start[2], ref.solution.drive]), axis=0)
    return bool(
        np.any(
            (change > (1 - EXCESS_LIMIT[Real.FLOAT]) * rate.rise)
            | (change < (1 - EXCESS_LIMIT[Real.FLOAT]) * rate.fall)
        )
    )


def _told(status: np.ndarray) -> np.ndarray:
    """Where a status says that a limit is passed because a drive may not change faster."""
    bits, S = status.astype(int), ControllerStatus
    return ((bits & S.RATE) > 0) & ((bits & (S.DISPLACEMENT | S.COMPOSITE | S.STATE)) > 0)


def _excess(model: Model, drives: np.ndarray, sample_time: float, x_0: np.ndarray) -> np.ndarray:
    """(n, limits): how far the model driven so goes beyond each limit, over the bound's size; 0 where it is kept."""
    reached = simulate(model, drives, sample_time, x_0)
    u = np.vstack([drives[:1], drives])
    values = model.evaluate_limits.map(len(u))(
        reached.x.T, reached.z.T, u.T, np.tile(model.p_nominal[:, None], (1, len(u)))
    )
    columns = []
    for limit, value in zip(model.limits, values, strict=True):
        v, size = (
            value.full().T,
            max(abs(limit.upper or 0.0), abs(limit.lower or 0.0)) or np.abs(value.full()).max() or 1.0,
        )
        over = np.zeros(len(u)) if limit.upper is None else v.max(axis=1) - limit.upper
        under = np.zeros(len(u)) if limit.lower is None else limit.lower - v.min(axis=1)
        columns.append(np.maximum(np.maximum(over, under), 0.0) / size)
    return np.column_stack(columns)


def _float_limit(model: Model, role: str, size: float, ref: ReferenceAnswers) -> float:
    """What `ROUNDINGS` float roundings of the largest value amount to; for the drive, of what it follows from."""
    eps = float(np.finfo(np.float32).eps)
    if role != "drive":
        return ROUNDINGS * eps * size
    off, first, states = 1 + ROUNDINGS / 2 * eps, 1 + model.u.numel(), 1 + model.u.numel() + len(model.axes)
    if isinstance(ref.controller.kernels, MotionKernels):
        rounded = (ref.controller.kernels.drive_sensitivity(target) for target in ref.command[::37])
        return max(max(rounded) * ROUNDINGS / 2 * eps, ROUNDINGS * eps * size)
    kernels = ref.controller.kernels.moving or ref.controller.kernels.static
    worst = 0.0
    for before, row in zip(ref.followed[:-1:37], ref.followed[1::37], strict=False):
        x = np.concatenate([before[states:], model.rest[model.n_states :]])
        z, wanted, state = before[first:states], row[first:states], row[states:]
        now = (x, z, before[1:first])
        moved = ref.controller.drive(kernels, now, wanted * off, state * off) - ref.controller.drive(
            kernels, now, wanted, state
        )
        worst = max(worst, float(np.max(np.abs(moved))))
    return max(worst, ROUNDINGS * eps * size)


def _row(build: str, what: str, label: str, unit: str, difference: np.ndarray, limit: float) -> ComparisonRow:
    """Worst and rms of a difference (n, channels) in SI; expressed in `unit`."""
    size = np.abs(difference).max(axis=1)
    beyond = np.flatnonzero(~(size <= limit))
    scale = from_si(1.0, unit) if unit not in ("K",) else 1.0
    worst, rms = float(size.max()) * scale, float(np.sqrt(np.mean(difference**2))) * scale
    return ComparisonRow(
        build, what, label, unit, worst, rms, limit * scale, len(difference), int(beyond[0]) if beyond.size else None
    )
