"""The online controller of the generated C against CasADi, IPOPT and the model, over the targets of the reference answers."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.feedforward import SECANT_FRACTION
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.online.limit_tables import FLOAT_SLACK
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import simulate, trace
from ctrlgen.numerics.newton import newton_solver
from ctrlgen.trajectory.playback import typical_length
from ctrlgen.verification.compared_program import ComparedProgram
from ctrlgen.verification.comparison_entry import ComparisonEntry, ComparisonKind, entry_of
from ctrlgen.verification.correction_comparison import correction_rows
from ctrlgen.verification.reference import ReferenceAnswers
from ctrlgen.verification.tolerances import (
    ANGLE_LIMIT,
    EXCESS_LIMIT,
    EXCESS_LIMIT_WITH_MEMORY,
    controller_limit,
    float_limit,
    length_limit,
    rounded,
)
from ctrlgen.verification.tracking import reached


def online_rows(program: ComparedProgram) -> list[ComparisonEntry]:
    """All comparisons of the online controller of one build."""
    ref = program.reference
    moving = ref.scenario.sample_time is not None
    typical = typical_length(ref.model.signals[ref.scenario.file.follow])
    start = ref.start if moving else ()
    followed = program.run("follow" if moving else "settle", ref.command, ref.width, start)
    settled = program.run("settle", ref.random, ref.width)
    # Far targets are large numbers that cancel in the displacement: the limit follows their roundings.
    far = max(1.0, ref.cancelling / float(np.abs(ref.model.z_bounds).max()))
    return [
        *_controller_rows(program, ComparisonKind.FOLLOWED, followed, ref.followed),
        *_controller_rows(program, ComparisonKind.SETTLED, settled, ref.settled, far),
        program.shipped_test(),
        *correction_rows(program),
        *_equilibrium_rows(program, settled),
        *(_hostile_rows(program) if moving else ()),
        *_optimum_rows(program, followed),
        *_about_rows(program),
        *program.off_command(
            ComparisonKind.ONLINE_PATH,
            ref.once("reached", followed, lambda answers: reached(ref, answers)) - ref.path,
            max(ANGLE_LIMIT[program.real], ref.held_error),
            max(length_limit(program.real, typical), ref.held_error),
        ),
    ]


def _controller_rows(
    program: ComparedProgram,
    what: ComparisonKind,
    answer: np.ndarray,
    expected: np.ndarray,
    wider: float = 1.0,
    ties: bool = False,
) -> list[ComparisonEntry]:
    """Answers against those of CasADi: status, drive, displacement, state.

    `ties`: a drive within rounding of limit plus slack may count as admissible in one and not in the other. Where the first
    difference is at such a sample, all may differ by what the last trial of the line search changes.
    """
    ref, real = program.reference, program.real
    if what is ComparisonKind.SETTLED and real is Real.FLOAT and not np.array_equal(answer[:, 0], expected[:, 0]):
        expected = ref.settled_in_float
    rows = [entry_of(program.build, what, "status", "1", _status_difference(ref, real, answer, expected), 0.0)]
    compared = np.ones(len(expected), bool)
    if real is Real.FLOAT:  # in float the line search may accept another trial, an equally good answer
        compared = (expected[:, 0].astype(int) & ControllerStatus.DRIVE) == 0
        if not compared.any():
            return rows
        answer, expected = answer[compared], expected[compared]
    off = {role: answer[:, columns] - expected[:, columns] for role, columns in ref.columns.items()}
    sizes = {
        role: np.abs(expected[:, columns]).max() or ref.model.signals[role].scale[0]
        for role, columns in ref.columns.items()
    }
    scaled = 1.0 if what is ComparisonKind.FOLLOWED else ref.condition  # by limits, which other targets meet
    limits = {role: controller_limit(role, scaled * size, ref, real, wider) for role, size in sizes.items()}
    if what is ComparisonKind.SETTLED and any(np.abs(off[role]).max() > limit for role, limit in limits.items()):
        # Beyond limits, what the inverse has not solved is held to its status and its limits
        undefined = (expected[:, 0] != 0) & ~ref.arrived[compared]
        off = {role: np.where(undefined[:, None], 0.0, values) for role, values in off.items()}
    differs = np.any([np.abs(off[role]).max(axis=1) > limit for role, limit in limits.items()], axis=0)
    if ties and differs.any() and int(expected[np.argmax(differs), 0]) & ControllerStatus.DRIVE:
        limits = {role: max(limit, _last_trial(ref.model, role)) for role, limit in limits.items()}
    return [*rows, *(program.row(what, role, off[role], limit) for role, limit in limits.items())]


def _status_difference(ref: ReferenceAnswers, real: Real, answer: np.ndarray, expected: np.ndarray) -> np.ndarray:
    """(n, 1) of the status. In float the slack is wider: what is within it is RATE in double alone."""
    status, wanted = answer[:, 0].astype(int), expected[:, 0].astype(int)
    if real is Real.FLOAT and ref.controller.rate is not None:
        slack, drive = ref.controller.kernels.slacks(FLOAT_SLACK)[2], ref.columns["drive"]
        same = np.all(np.abs(answer[:, drive] - expected[:, drive]) <= slack, axis=1)
        status, wanted = (np.where(same, s & ~ControllerStatus.RATE, s) for s in (status, wanted))
    return (status - wanted)[:, None]


def _last_trial(m: Model, role: str) -> float:
    """The largest change [SI] that the third trial of the line search can still make."""
    states = (m.x_bounds[0][: m.n_states], m.x_bounds[1][: m.n_states])
    low, high = {"displacement": m.z_bounds, "state": states, "drive": m.u_bounds}[role]
    return (1 - SECANT_FRACTION) ** 2 * float(np.max(high - low, initial=0.0))


def _equilibrium_rows(program: ComparedProgram, settled: np.ndarray) -> list[ComparisonEntry]:
    """The model at rest under the drives of reachable targets that no limit moved, less the target."""
    ref, real, rows = program.reference, program.real, list[ComparisonEntry]()
    # by the status of CasADi: C that reports a limit too often is held to all of them
    plain = np.flatnonzero(ref.settled[: len(ref.random) // 2, 0] == 0)
    if not plain.size:
        return rows
    wanted = ref.positions[plain]
    off = ref.once("equilibria", settled[plain], lambda answers: _equilibria(ref, answers)) - wanted
    typical = typical_length(ref.model.signals[ref.scenario.file.follow])
    for unit, span in program.followed_channels():
        least = ANGLE_LIMIT[real] if unit == "rad" else length_limit(real, typical)
        limit = max(least, rounded(real, wanted[:, span]))
        rows.append(program.row(ComparisonKind.EQUILIBRIA, ref.scenario.file.follow, off, limit, span))
    return rows


def _equilibria(ref: ReferenceAnswers, answers: np.ndarray) -> np.ndarray:
    """(n, channels): the model's equilibria under constant drives, by simulation, not by the inverse."""
    m = ref.model
    drives = answers[:, ref.columns["drive"]]
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
        start[:, len(m.rest) :] = answers[:, ref.columns["displacement"]] / m.z_scale
    roots = newton.map(len(drives))(start.T, drives.T).full().T
    states, displacements = roots[:, : len(m.rest)] * m.x_scale + m.rest, roots[:, len(m.rest) :] * m.z_scale
    return trace(m, np.zeros(len(drives)), states, displacements, drives).signals[ref.scenario.file.follow]


def _hostile_rows(program: ComparedProgram) -> list[ComparisonEntry]:
    """Jumps between reachable and absurd targets, from rest: against CasADi, against the limits, against the rates."""
    ref, real, rows = program.reference, program.real, list[ComparisonEntry]()
    m, cold = ref.model, ref.controller.rest()
    chased = program.run("follow", ref.hostile, ref.width, cold)
    drives = chased[:, ref.columns["drive"]]
    if real is Real.DOUBLE:  # in float the line searches accept other trials, and the states drift apart
        rows += _controller_rows(program, ComparisonKind.CHASED, chased, ref.chased, ties=True)
        if ref.timed is not None:
            records, expected = ref.timed
            answer = program.run("timed", records, ref.width)
            rows += _controller_rows(program, ComparisonKind.TIMED, answer, expected, ties=True)
    if not m.inertial:  # where jumping targets take a mass, no drive can decide any more
        allowed = EXCESS_LIMIT[real] if m.x.numel() == m.n_states else EXCESS_LIMIT_WITH_MEMORY
        over = ref.once("excess", drives, lambda drives: excess(m, drives, ref.sample_time, cold[0])).copy()
        over[1:][_limited_by_rate(chased[:, 0])] = 0.0
        rows.append(entry_of(program.build, ComparisonKind.EXCESS, "share of its bound", "1", over, allowed))
    if (rate := ref.controller.rate) is not None:
        change = np.diff(np.vstack([cold[2], drives]), axis=0)
        over = np.maximum(np.maximum(change - rate.rise, rate.fall - change), 0.0) / m.u_scale
        rows.append(entry_of(program.build, ComparisonKind.RATE, "share of its size", "1", over, EXCESS_LIMIT[real]))
    return rows


def _limited_by_rate(status: np.ndarray) -> np.ndarray:
    """Where a status says that a limit is passed because a drive may not change faster."""
    bits, S = status.astype(int), ControllerStatus
    return ((bits & S.RATE) > 0) & ((bits & (S.DISPLACEMENT | S.COMPOSITE | S.STATE)) > 0)


def excess(model: Model, drives: np.ndarray, sample_time: float, x_0: np.ndarray) -> np.ndarray:
    """(n, limits): how far a model driven so goes beyond each limit, over the bound's size; 0 where it is kept."""
    along = simulate(model, drives, sample_time, x_0)
    u = np.vstack([drives[:1], drives])
    columns = []
    for limit, v in zip(model.limits, model.limited_values(along.x, along.z, u), strict=True):
        size = max(abs(limit.upper or 0.0), abs(limit.lower or 0.0)) or np.abs(v).max() or 1.0
        over = np.zeros(len(u)) if limit.upper is None else v.max(axis=1) - limit.upper
        under = np.zeros(len(u)) if limit.lower is None else limit.lower - v.min(axis=1)
        columns.append(np.maximum(np.maximum(over, under), 0.0) / size)
    return np.column_stack(columns)


def _optimum_rows(program: ComparedProgram, followed: np.ndarray) -> list[ComparisonEntry]:
    """The drives against IPOPT's, where both have the same to decide: with inertia the solved drives make up for being held, which those
    of the online C do not."""
    ref, m = program.reference, program.reference.model
    if m.inertial or (m.redundant and _rates_act(ref)):
        return []
    solved = ref.solution.drive
    # ten times IPOPT's own tolerance; that of the least effort is one of the effort, which hardly changes near its least and at a limit
    limit = (1e-5 if m.redundant else 1e-8) * m.u_scale.max()
    if program.real is Real.FLOAT:
        limit = max(limit, float_limit("drive", np.abs(solved).max(), ref))
    return [program.row(ComparisonKind.OPTIMUM, "drive", followed[:, ref.columns["drive"]] - solved, limit)]


def _about_rows(program: ComparedProgram) -> list[ComparisonEntry]:
    """Targets of the poses of pivots: status, and numbers over what roundings may change them by."""
    ref, real = program.reference, program.real
    if ref.turned is None:
        return []
    pivots, poses, accepted = ref.turned
    pivots, poses = real.held(pivots), real.held(poses)
    answer = program.run("about", np.hstack([pivots, poses]), poses.shape[1])
    status = answer[:, :1] - np.where(accepted, 0, ControllerStatus.INPUT)[:, None]
    off = answer[:, 1:].copy()  # of what is refused nothing is written
    for k in np.flatnonzero(accepted):
        difference = np.abs(off[k] - ref.pivot.function(poses[k], pivots[k]).full().ravel())
        off[k] = difference / np.maximum(ref.pivot.rounding(poses[k], pivots[k], real), np.finfo(np.float32).tiny)
    what = ComparisonKind.ABOUT
    return [
        entry_of(program.build, what, "status", "1", status, 0.0),
        entry_of(program.build, what, "share of its rounding", "1", off, 1.0),
    ]


def _rates_act(ref: ReferenceAnswers) -> bool:
    """Whether a rate is met in the solution: the solver then chooses among more drives than axes with the whole path in view."""
    if (rate := ref.controller.rate) is None:
        return False
    change, near = np.diff(np.vstack([ref.start[2], ref.solution.drive]), axis=0), 1 - EXCESS_LIMIT[Real.FLOAT]
    return bool(np.any((change > near * rate.rise) | (change < near * rate.fall)))
