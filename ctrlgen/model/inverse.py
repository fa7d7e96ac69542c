"""The inverse of a model, symbolically: target of a signal -> displacement -> actuator state -> drive.

It is derived from the equations of any `Model` at the end of a sample,

    followed(x+, z+, u) = target,  g(x+, z+, u) = 0,  x+ = held_step(x, z, u)  (static: rates = 0).

They are sorted into blocks by block triangular form (I. S. Duff, J. K. Reid, ACM TOMS 4 (1978) 137), and each block is
solved in the cheapest exact way: a linear one in closed form, one quadratic equation by its root, anything else by a fixed
number of Newton steps. The operation count is therefore fixed.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from ctrlgen.model.discretisation import held_step
from ctrlgen.model.model import Model
from ctrlgen.numerics.newton import newton_root

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


def invert(model: Model, follow: str, sample_time: float | None, symbolic: bool = False) -> Inverse:
    """The inverse of `model` for the signal named `follow`, over one `sample_time` [s]; static where that is None.

    Free parameters take their nominal values, and where it is `symbolic` stay a last argument "p" of every kernel: the
    inverse at the nominal values, with its numbers as formulas of the parameters (those of the followed signal excepted).
    """
    x, z, u, n, n_s = model.x, model.z, model.u, len(model.axes), model.n_states
    x_1, z_1, u_1 = (ca.SX.sym(f"{s}1", v.numel()) for s, v in (("x", x), ("z", z), ("u", u)))
    heat, target = model.heat, ca.SX.sym("target", model.signals[follow].expr.numel())
    p = model.p if symbolic else ca.SX(ca.DM(model.p_nominal))
    now, end = ca.vertcat(x, z, u, model.p), ca.vertcat(x_1, z_1, u_1, p)
    known = ExpansionPoint.of(
        (x, model.rest, model.x_scale),
        (z, 0 * model.z_scale, model.z_scale),
        (target, np.zeros(target.numel()), np.zeros(target.numel())),
        (x_1, model.rest, model.x_scale),
        (z_1, 0 * model.z_scale, model.z_scale),
        (u_1, 0 * model.u_scale, model.u_scale),
        (heat, np.zeros(heat.numel()), np.ones(heat.numel())),
        (model.p, model.p_nominal, np.zeros(model.p.numel())),
    )
    if symbolic:
        known = replace(
            known,
            parameters=model.p,
            with_formula=ca.vertcat(x, x_1),
            base_formula=ca.vertcat(model.rest_formula, model.rest_formula),
        )
    followed, balance, rates, produced = (
        ca.substitute(e, now, end)
        for e in (model.signals[follow].expr, model.balance, model.rates_of_heat, model.heat_of_drive)
    )
    if sample_time is None:
        motion = rates[:]
        velocities = range(x.numel() - model.v.numel(), x.numel())
        # The first two have no equilibrium: they start anew, at zero
        for i in (
            *model.stepped,
            *model.clocks,
            *velocities,
        ):
            motion[i] = x_1[i]
        reached = ca.substitute(solve_by_blocks(known, motion, x_1), z_1, z)  # the equilibrium states at the given z
        at_rest = ca.vertcat(reached, z, u_1, p)
        for i, value in model.stepped.items():
            reached[i] = ca.substitute(value, now, at_rest)
    else:
        reached = ca.substitute(held_step(model, sample_time, model.rates_of_heat), model.p, p)
        reached = ca.substitute(reached, u, u_1)
        motion = x_1 - reached
        produced = ca.substitute(model.heat_of_drive, ca.vertcat(u, model.p), ca.vertcat(u_1, p))
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
    settled = ca.substitute(model.balance, model.p, p)
    advance = ca.substitute(reached, heat, ca.substitute(produced, x_1, reached) if sample_time is None else produced)
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
    more = {"p": model.p} if symbolic else {}
    return Inverse(**{name: _kernel(name, arguments | more, result) for name, (arguments, result) in results.items()})


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
        return ca.Function("f", [self.symbols], [expression])(self.base + fraction * self.scale).full()

    def base_of(self, unknowns: ca.SX) -> ca.SX | ca.DM:
        """The base of some of the symbols."""
        base = ca.Function("f", [self.symbols], [unknowns])(self.base)
        formulas = ca.substitute(unknowns, self.with_formula, self.base_formula)
        same = [ca.is_equal(formulas[i], unknowns[i]) for i in range(unknowns.numel())]
        return ca.vertcat(*(base[i] if same[i] else formulas[i] for i in range(unknowns.numel())))

    def typical(self, unknowns: ca.SX) -> ca.DM:
        """A value of some of the symbols at which the device operates: base + scale."""
        return ca.Function("f", [self.symbols], [unknowns])(self.base + self.scale)


def solve_by_blocks(known: ExpansionPoint, equations: ca.SX, unknowns: ca.SX) -> ca.SX:
    """The `unknowns` (n,) as expressions in the other symbols, such that equations (n,) = 0; block by block."""
    count, rows, columns, row_starts, column_starts, *_ = ca.jacobian(equations, unknowns).sparsity().btf()
    solution = [ca.SX(0)] * unknowns.numel()
    solved = values = ca.SX(0, 1)
    for block in range(count):
        places = columns[column_starts[block] : column_starts[block + 1]]
        own_equations = equations[rows[row_starts[block] : row_starts[block + 1]]]
        v = unknowns[places]
        root = _solve_block(known, ca.substitute(own_equations, solved, values), v)
        for k, i in enumerate(places):
            solution[i] = root[k]
        solved, values = ca.vertcat(solved, v), ca.vertcat(values, root)
    return ca.vertcat(*solution)


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
