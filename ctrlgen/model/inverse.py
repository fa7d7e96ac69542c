"""The inverse of a model, symbolically: target of a signal -> displacement -> actuator state -> drive.

It is derived from the equations of any `Model` at the end of a sample,

    followed(x+, z+, u) = target,  g(x+, z+, u) = 0,  x+ = held_step(x, z, u)  (static: rates = 0).

Where the drive puts a stage elsewhere at once, what remembers its displacement is given z+ for z (`at_displacement`).

They are sorted into blocks by block triangular form (I. S. Duff, J. K. Reid, ACM TOMS 4 (1978) 137), and each block is
solved in the cheapest exact way: a linear one in closed form, one quadratic equation by its root, anything else by a fixed
number of Newton steps. The operation count is therefore fixed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.effects import Effect
from ctrlgen.model.discretisation import at_displacement, held_step, jumps, varied_step
from ctrlgen.model.model import Model
from ctrlgen.numerics.newton import newton_root, steps_needed

# Operations at which an expression is not differentiable:
CORNERS = frozenset((ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_SIGN, ca.OP_FLOOR, ca.OP_CEIL, ca.OP_IF_ELSE_ZERO))
ROUNDED_ZERO = 1e-12  # of the largest entry of an equilibrated inverse: entries below it are zeros that were rounded
NEWTON_STEPS = 6  # from a typical size away; quadratic convergence leaves rounding only


@dataclass(frozen=True)
class Inverse:
    """Kernels, SX functions in SI, that a controller calls in this order.

    `displacement` (x, z, target) -> z at the next sample; `state` (x, z, z_wanted) -> actuator states (n_states,) that hold
    it, none for actuators without memory; `drive` (x, z, z_wanted, state_wanted) -> u; `memory` (x, z, z_wanted) -> the
    effects' states then; `advance` (x, z, u) -> x at the next sample; `settle` (x, z, u) -> the displacement that balances
    the forces at x, by `NEWTON_STEPS` of Newton's method from z, of which `newton` is one. x, z are those of the present sample. A
    static inverse does not depend on them, except that its `advance` takes the new z.
    """

    displacement: ca.Function
    state: ca.Function
    drive: ca.Function
    memory: ca.Function
    advance: ca.Function
    settle: ca.Function
    newton: ca.Function

    def at(self, sample_time: float) -> Inverse:
        """Of kernels with a sample time "h" as their last argument: those over this one [s]."""
        return Inverse(*(_over(getattr(self, kernel.name), sample_time) for kernel in fields(self)))


def _over(kernel: ca.Function, sample_time: float) -> ca.Function:
    names = kernel.name_in()[:-1]
    given = [ca.SX.sym(name, *kernel.size_in(name)) for name in names]
    return ca.Function(kernel.name(), given, [kernel(*given, sample_time)], names, ["result"])


@lru_cache(maxsize=8)  # a path is solved, and its controller made, of one model
def invert(
    model: Model, follow: str, sample_time: float | None, symbolic: bool = False, longest: float | None = None
) -> Inverse:
    """The inverse of `model` for the signal named `follow`, over one `sample_time` [s]; static where that is None.

    Free parameters take their nominal values, and where it is `symbolic` stay a last argument "p" of every kernel: the
    inverse at the nominal values, with its numbers as formulas of the parameters (those of the followed signal excepted).
    With a `longest` sample time [s] it is a last argument "h" of every kernel, and `sample_time` where they are expanded.
    Raises InputError for a model whose drives are delivered with a memory of samples.
    """
    _check_delivered(model)
    x, z, u, n, n_s, heat = model.x, model.z, model.u, len(model.axes), model.n_states, model.heat
    end = _SampleEnd.of(model, follow, symbolic)
    x_1, z_1, u_1, target = end.x, end.z, end.u, end.target
    h = ca.SX.sym("h", 0 if longest is None else 1)
    known = _expansion_point(model, end, symbolic, (h, sample_time or 0.0))
    followed, balance = (end.of_end(model, e) for e in (model.signals[follow].expr, model.balance))
    if sample_time is None:
        reached, motion, produced = _equilibrium(model, end, known)
    else:
        stepped = (
            held_step(model, sample_time, model.rates_of_heat)
            if longest is None
            else varied_step(model, h, longest, model.rates_of_heat)
        )
        if jumps(model, stepped):
            stepped = at_displacement(model, stepped, z_1)
        reached, motion, produced = _held(model, end, stepped)
    heating = heat - produced
    followed = ca.substitute(followed, model.p, ca.DM(model.p_nominal))
    wanted_z = solve_by_blocks(
        known, ca.vertcat(followed - target, balance, motion, heating), ca.vertcat(z_1, x_1, u_1, heat)
    )[:n]
    # The later kernels take the earlier results as arguments, because the controller limits them in between.
    later = solve_by_blocks(known, ca.vertcat(balance, motion, heating), ca.vertcat(x_1, u_1, heat))
    wanted_state, memory = later[:n_s], later[n_s : x.numel()]
    drive_of_state = ca.substitute(ca.vertcat(motion[:n_s], heating), x_1[n_s:, :], memory)
    wanted_u = (
        solve_by_blocks(known, drive_of_state, ca.vertcat(heat, u_1))[n:] if n_s else later[x.numel() : x.numel() + n]
    )
    settled = ca.substitute(model.balance, model.p, end.p)
    advance = ca.substitute(reached, heat, ca.substitute(produced, x_1, reached) if sample_time is None else produced)
    if ca.depends_on(advance, z_1):
        then = ca.substitute(balance, x_1, advance)
        advance = ca.substitute(advance, z_1, newton_root(then, z_1, z, steps_needed(then, z_1, NEWTON_STEPS)))
    states = x_1[:n_s]
    results: dict[str, tuple[dict[str, ca.SX], ca.SX]] = {
        "displacement": ({"x": x, "z": z, "target": target}, wanted_z),
        "state": ({"x": x, "z": z, "wanted": z_1}, wanted_state),
        "drive": ({"x": x, "z": z, "wanted": z_1, "state": states}, wanted_u),
        "memory": ({"x": x, "z": z, "wanted": z_1}, memory),
        "advance": ({"x": x, "z": z, "drive": u_1}, advance),
        "settle": ({"x": x, "z": z, "drive": u}, newton_root(settled, z, z, NEWTON_STEPS)),
        "newton": ({"x": x, "z": z, "drive": u}, newton_root(settled, z, z, 1)),
    }
    more = ({"p": model.p} if symbolic else {}) | ({} if longest is None else {"h": h})
    return Inverse(**{name: _kernel(name, arguments | more, result) for name, (arguments, result) in results.items()})


def _check_delivered(model: Model) -> None:
    """Refuses a model with memories that rest only after many samples, such as those of a drive whose rate is limited: over one sample what
    a drive is beyond that rate moves nothing, and there is no root; and one whose drive goes in steps. Raises InputError."""
    what = "looks back by samples and is not inverted: build the model without a sample time"
    if model.not_inverted:
        kinds = [(k, e.kind) for k, e in enumerate(model.device.effect) if e.kind in model.not_inverted]
        why = "gives a drive in steps and is not inverted: build the model without a sample time"
        raise InputError(model.name, [Fault(f"effect[{k}].kind", f"{kind} {why}") for k, kind in kinds])
    if model.resting:
        kinds = [(k, e.kind) for k, e in enumerate(model.device.effect) if type(e).resting is not Effect.resting]
        raise InputError(model.name, [Fault(f"effect[{k}].kind", f"{kind} {what}") for k, kind in kinds])


@dataclass(frozen=True)
class _SampleEnd:
    """The symbols at the end of a sample: states `x`, displacements `z`, drives `u`, and the `target` of the followed signal; and the
    parameters `p`, symbols or nominal values."""

    x: ca.SX
    z: ca.SX
    u: ca.SX
    target: ca.SX
    p: ca.SX

    @classmethod
    def of(cls, model: Model, follow: str, symbolic: bool) -> _SampleEnd:
        """The end of a sample of `model`, whose parameters stay symbols where it is `symbolic`."""
        x, z, u = (ca.SX.sym(f"{s}1", v.numel()) for s, v in (("x", model.x), ("z", model.z), ("u", model.u)))
        target = ca.SX.sym("target", model.signals[follow].expr.numel())
        return cls(x, z, u, target, model.p if symbolic else ca.SX(ca.DM(model.p_nominal)))

    def of_end(self, model: Model, expression: ca.SX) -> ca.SX:
        """An `expression` of the model with the symbols of the end."""
        now = ca.vertcat(model.x, model.z, model.u, model.p)
        return ca.substitute(expression, now, ca.vertcat(self.x, self.z, self.u, self.p))


def _expansion_point(model: Model, end: _SampleEnd, symbolic: bool, time: tuple[ca.SX, float]) -> ExpansionPoint:
    """Rest and typical sizes of a `model`, for its symbols now and at the `end`, and for a sample `time`, with its value; rest as formulas
    where it is `symbolic`."""
    target, heat = end.target.numel(), model.heat.numel()
    known = ExpansionPoint.of(
        (model.x, model.rest, model.x_scale),
        (model.z, 0 * model.z_scale, model.z_scale),
        (end.target, np.zeros(target), np.zeros(target)),
        (end.x, model.rest, model.x_scale),
        (end.z, 0 * model.z_scale, model.z_scale),
        (end.u, 0 * model.u_scale, model.u_scale),
        (model.heat, np.zeros(heat), np.ones(heat)),
        (model.p, model.p_nominal, np.zeros(model.p.numel())),
        (time[0], np.full(time[0].numel(), time[1]), np.zeros(time[0].numel())),
    )
    if not symbolic:
        return known
    formulas = ca.vertcat(model.rest_formula, model.rest_formula)
    return replace(known, parameters=model.p, with_formula=ca.vertcat(model.x, end.x), base_formula=formulas)


def _equilibrium(model: Model, end: _SampleEnd, known: ExpansionPoint) -> tuple[ca.SX, ca.SX, ca.SX]:
    """The states of the equilibrium at the displacements now, the residual of the states at the `end`, and the heat produced there."""
    rates, produced = (end.of_end(model, e) for e in (model.rates_of_heat, model.heat_of_drive))
    motion = rates[:]
    velocities = range(model.x.numel() - model.v.numel(), model.x.numel())
    # The first two have no equilibrium: they start anew, at zero
    for i in (*model.stepped, *model.clocks, *velocities):
        motion[i] = end.x[i]
    reached = ca.substitute(solve_by_blocks(known, motion, end.x), end.z, model.z)
    now, at_rest = ca.vertcat(model.x, model.z, model.u, model.p), ca.vertcat(reached, model.z, end.u, end.p)
    for i, value in model.stepped.items():
        reached[i] = ca.substitute(value, now, at_rest)
    return reached, motion, produced


def _held(model: Model, end: _SampleEnd, stepped: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """The states, as `stepped` over one sample, under the held drives of its `end`, the residual of the states there, the heat produced."""
    reached = ca.substitute(stepped, model.p, end.p)
    reached = ca.substitute(reached, model.u, end.u)
    produced = ca.substitute(model.heat_of_drive, ca.vertcat(model.u, model.p), ca.vertcat(end.u, end.p))
    return reached, end.x - reached, produced


def _kernel(name: str, arguments: dict[str, ca.SX], result: ca.SX) -> ca.Function:
    return ca.Function(name, list(arguments.values()), [result], list(arguments), ["result"], {"cse": True})


@dataclass(frozen=True)
class ExpansionPoint:
    """Symbols with the point about which equations are expanded (`base`) and a typical distance from it (`scale`), SI."""

    symbols: ca.SX
    base: np.ndarray
    scale: np.ndarray
    # For numbers with formulas: those of the symbols that never change, and expressions in them of the base of some symbols
    parameters: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    with_formula: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    base_formula: ca.SX = field(default_factory=lambda: ca.SX(0, 1))

    @classmethod
    def of(cls, *rows: tuple[ca.SX, np.ndarray, np.ndarray]) -> ExpansionPoint:
        """The point given by (symbol, base, scale) of each vector."""
        symbols, bases, scales = zip(*rows, strict=True)
        return cls(ca.vertcat(*symbols), np.concatenate(bases), np.concatenate(scales))

    def at(self, expression: ca.SX, fraction: float) -> np.ndarray:
        """`expression` at base + fraction * scale."""
        if not ca.symvar(expression):
            return ca.evalf(expression).full()
        return ca.Function("f", [self.symbols], [expression])(self.base + fraction * self.scale).full()

    def base_of(self, unknowns: ca.SX) -> ca.SX | ca.DM:
        """The base of some of the symbols."""
        own = [symbol.element_hash() for symbol in ca.vertsplit(unknowns)]
        if not any(symbol in self._formulas for symbol in own):
            return ca.DM(self.base[[self._places[symbol] for symbol in own]])
        return ca.vertcat(*(self._formulas.get(symbol, self.base[self._places[symbol]]) for symbol in own))

    def typical(self, unknowns: ca.SX) -> ca.DM:
        """A value of some of the symbols at which the device operates: base + scale."""
        places = [self._places[symbol.element_hash()] for symbol in ca.vertsplit(unknowns)]
        return ca.DM((self.base + self.scale)[places])

    @cached_property
    def _places(self) -> dict[int, int]:
        """Where a symbol stands among `symbols`."""
        return {symbol.element_hash(): i for i, symbol in enumerate(ca.vertsplit(self.symbols))}

    @cached_property
    def _formulas(self) -> dict[int, ca.SX]:
        """The base of symbols that have a formula of it."""
        symbols, formulas = ca.vertsplit(self.with_formula), ca.vertsplit(self.base_formula)
        return {symbol.element_hash(): formula for symbol, formula in zip(symbols, formulas, strict=True)}


def solve_by_blocks(known: ExpansionPoint, equations: ca.SX, unknowns: ca.SX) -> ca.SX:
    """The `unknowns` (n,) as expressions in the other symbols, such that equations (n,) = 0; block by block."""
    entries = ca.jacobian(equations, unknowns).sparsity()
    count, rows, columns, row_starts, column_starts, *_ = entries.btf()
    by_equation = entries.T
    starts, needs = by_equation.colind(), by_equation.row()
    residuals, symbols = ca.vertsplit(equations), ca.vertsplit(unknowns)
    solution: dict[int, ca.SX] = {}
    for block in range(count):
        places = columns[column_starts[block] : column_starts[block + 1]]
        own = rows[row_starts[block] : row_starts[block + 1]]
        v, r = (ca.vertcat(*those) for those in ([symbols[i] for i in places], [residuals[k] for k in own]))
        before = sorted({i for k in own for i in needs[starts[k] : starts[k + 1]] if i in solution})
        if before:
            r = ca.substitute(r, *(ca.vertcat(*(those[i] for i in before)) for those in (symbols, solution)))
        solution |= zip(places, ca.vertsplit(_solve_block(known, r, v)), strict=True)
    return ca.vertcat(*(solution[i] for i in range(len(symbols))))


def _solve_block(known: ExpansionPoint, r: ca.SX, v: ca.SX) -> ca.SX:
    """One block, r(v) = 0: linear, quadratic in one unknown, or `NEWTON_STEPS` Newton steps."""
    base = known.base_of(v)
    slope = ca.jacobian(r, v)
    fixed = {symbol.name() for symbol in ca.symvar(known.parameters)} if known.parameters.numel() else set()
    constant = all(symbol.name() in fixed for symbol in ca.symvar(slope))
    if constant and (v.numel() > 1 or not ca.symvar(slope)):  # inverted once, when the kernel is built
        return base - ca.mtimes(_inverse(known.at(slope, 0.0)), ca.substitute(r, v, base))
    if not ca.depends_on(slope, v):
        return base - ca.solve(slope, ca.substitute(r, v, base))
    curvature = ca.jacobian(slope, v)
    if v.numel() == 1 and not ca.depends_on(curvature, v) and not _has_corners(slope):
        return base + _rising_root(known, r, v, base, slope, curvature)
    return newton_root(r, v, ca.SX(known.typical(v)), NEWTON_STEPS)


def _inverse(slope: np.ndarray) -> ca.DM:
    """The inverse (n, n) of a matrix, computed with rows and columns scaled to order one; entries that are only rounding are
    set to zero."""
    if slope.size == 1 and slope[0, 0] != 0.0:  # the same operations, of numbers
        number = float(slope[0, 0])
        row = 1 / abs(number)
        column = 1 / abs(row * number)
        return ca.DM(column * (1 / (row * number * column)) * row)
    rows = 1 / np.abs(slope).max(axis=1)
    columns = 1 / np.abs(rows[:, None] * slope).max(axis=0)
    scaled = np.linalg.inv(rows[:, None] * slope * columns)
    scaled[np.abs(scaled) < ROUNDED_ZERO * np.abs(scaled).max()] = 0.0
    return ca.sparsify(ca.DM(columns[:, None] * scaled * rows))


def _has_corners(slope: ca.SX) -> bool:
    """Whether a slope jumps, as that of a play or a dead zone does: then r is not quadratic although its curvature is constant."""
    f = ca.Function("slope", ca.symvar(slope), [slope])
    return any(f.instruction_id(k) in CORNERS for k in range(f.n_instructions()))


def _rising_root(known: ExpansionPoint, r: ca.SX, v: ca.SX, base: ca.DM, slope: ca.SX, curvature: ca.SX) -> ca.SX:
    """The root of a quadratic on the side of `base` on which the device operates, free of cancellation.

    r(base + w) = C + B w + A w^2, its sign chosen so that r rises there: w = -2 C / (B + sqrt(B^2 - 4 A C)).
    Where B is zero, w = sqrt(-C/A) with the sign of -C/A: a target on the side that cannot be reached gives a value
    outside the limits, which the controller reports, and not a valid one.
    """
    sign = float(np.sign(known.at(slope, 1.0)[0, 0]))
    A, B, C = sign * curvature / 2, sign * ca.substitute(slope, v, base), sign * ca.substitute(r, v, base)
    if ca.simplify(B).is_zero():
        ratio = -C / A
        return ca.sign(ratio) * ca.sqrt(ca.fabs(ratio))
    return -2 * C / (B + ca.sqrt(ca.fmax(B**2 - 4 * A * C, 0)))
