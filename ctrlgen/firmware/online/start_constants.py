"""The part of the online controller's context that concerns the constants given when it starts.

They are a structure of the caller's, checked against their bounds; what the kernels need of them is computed once, by `derive`, in the
C's own arithmetic, and kept in the state. `derived_values` is the same arithmetic in Python.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.devices.run_time import RunTimeConstant
from ctrlgen.firmware.c.c_constants import Derived
from ctrlgen.firmware.c.cprint import Printer
from ctrlgen.firmware.c.expression_graph import Node, reached
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.online.constants_layout import CRC_POLYNOMIAL, MAGIC, OVERHEAD, VERSION
from ctrlgen.numerics.interval_arithmetic import Interval

FIRST = 64  # bit of the status for constants out of bounds, behind those of a controller


class Tables:
    """Tables of limits as C: of numbers that are known now, or members of the state that follow from the constants of the start."""

    def __init__(self, kernels: ControllerKernels, printer: Printer) -> None:
        self._printer, self._real = printer, printer.real
        self._model = None if kernels.given is None else kernels.given.model

    def rows(self, formula: Callable[[Any], ca.SX], values: np.ndarray) -> list[Node] | None:
        """The rows of a table as nodes, where one of them follows from the constants; else None. `formula` of the symbolic model."""
        if self._model is None:
            return None
        function = ca.Function("table", [self._model.p], [formula(self._model)], ["p"], ["result"])
        nodes = self._printer.table(function)
        return nodes if any(node.source for node in nodes) else None

    def texts(self, formula: Callable[[Any], ca.SX], values: np.ndarray) -> list[str]:
        """Each row in a kernel or a function with an argument `derived`; empty for a zero."""
        nodes = self.rows(formula, values)
        if nodes is None:
            return [self._real.literal(v) if v != 0.0 else "" for v in values]
        return [self._printer.member(node) for node in nodes]

    def each(self, static: str, formula: Callable[[Any], ca.SX], values: np.ndarray) -> list[str]:
        """Each row as a member of the state; empty where the table is the `static` one."""
        nodes = self.rows(formula, values)
        return [] if nodes is None else [_of_state(self._printer.member(node)) for node in nodes]

    def array(self, static: str, formula: Callable[[Any], ca.SX], values: np.ndarray) -> str:
        """The whole table: the name of a `static` one, or the member of the same name of the state."""
        nodes = self.rows(formula, values)
        return static if nodes is None else _of_state(self._printer.array(nodes, static.lower()))


def _of_state(text: str) -> str:
    return text.replace("derived->", "state->derived.")


def given_ranges(kernels: ControllerKernels) -> dict[str, Interval]:
    """Path and range of the constants of the start."""
    return {c.path: (c.low, c.high) for c in kernels.model.device.given_at_start}


def start_context(kernels: ControllerKernels, printer: Printer) -> dict[str, Any]:
    """What online.c.j2 and online.h.j2 need of the constants of the start; all kernels and tables have been printed."""
    device, real = kernels.model.device, printer.real
    constants = device.given_at_start
    if not constants:
        return {"given": (), "given_numbers": 0, "derived": (), "derive": None, "changing": None}
    members = printer.derived
    _check(kernels, members, constants)
    changing = None
    if device.run_time is not None and device.run_time.input is not None:
        constant = next(c for c in constants if c.path == device.run_time.input)
        some = [member for member in members if printer.depends(member, constant.path)]
        kernel = printer.starting(some, "derive_input", f"What follows from {constant.path}, which may change.")
        changing = {"constant": constant, "kernel": kernel, "assigned": _assigned(some)}
    derive = printer.starting(members, "derive", "What follows from the constants that the controller is given.")
    return {
        "given": [_described(c, real) for c in constants],
        "given_numbers": len(constants) + len(_assigned(members)),
        "derived": members,
        "derive": derive,
        "assigned": _assigned(members),
        "changing": changing,
        "refused": FIRST,
        "magic": int.from_bytes(MAGIC, "little"),
        "layout": VERSION + (len(constants) << 16),
        "crc_polynomial": CRC_POLYNOMIAL,
        "overhead": OVERHEAD,
    }


def _described(c: RunTimeConstant, real: Real) -> dict[str, Any]:
    default = real.literal(c.default)
    about = f"{c.base_unit}, {c.low:.7g} ... {c.high:.7g}: {c.path}, {c.shown(c.default)} in the file"
    return {"name": c.name, "low": c.low, "high": c.high, "default": default, "about": about}


def _assigned(members: Sequence[Derived]) -> list[tuple[str, int]]:
    """Element of the structure, and its place in what `derive` gives."""
    names = [m.name if len(m.nodes) == 1 else f"{m.name}[{k}]" for m in members for k in range(len(m.nodes))]
    return list(zip(names, range(len(names)), strict=True))


def derived_values(members: Sequence[Derived], given: Sequence[float], real: Real) -> np.ndarray:
    """What `derive` computes from the numbers `given`, operation by operation in the C's arithmetic; elementary functions are those of
    numpy, which are within a rounding or two of the C's."""
    kind = np.float32 if real is Real.FLOAT else np.float64
    sources = [source for member in members for source in member.sources]
    computed: dict[int, Any] = {}
    with np.errstate(all="ignore"):
        for node in reached(sources):
            if node.constant:
                computed[node.number] = kind(node.value)
            elif node.array:
                computed[node.number] = kind(given[node.index])
            else:
                computed[node.number] = kind(_OPERATIONS[node.operation](*(computed[n.number] for n in node.operands)))
    return np.array([computed[source.number] for source in sources])


_OPERATIONS: Mapping[int, Callable[..., Any]] = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_SQRT: np.sqrt,
    ca.OP_EXP: np.exp,
    ca.OP_LOG: np.log,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_TAN: np.tan,
    ca.OP_ASIN: np.arcsin,
    ca.OP_ACOS: np.arccos,
    ca.OP_ATAN: np.arctan,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_TANH: np.tanh,
    ca.OP_SINH: np.sinh,
    ca.OP_COSH: np.cosh,
    ca.OP_POW: np.power,
    ca.OP_CONSTPOW: np.power,
    ca.OP_FMIN: np.fmin,
    ca.OP_FMAX: np.fmax,
    ca.OP_FABS: np.abs,
    ca.OP_SIGN: np.sign,
    ca.OP_FLOOR: np.floor,
    ca.OP_CEIL: np.ceil,
    ca.OP_LT: np.less,
    ca.OP_LE: np.less_equal,
    ca.OP_EQ: np.equal,
    ca.OP_NE: np.not_equal,
    ca.OP_NOT: np.logical_not,
    ca.OP_AND: np.logical_and,
    ca.OP_OR: np.logical_or,
    ca.OP_IF_ELSE_ZERO: lambda condition, value: value if condition else 0.0,
}


def _check(kernels: ControllerKernels, members: Sequence[Derived], constants: Sequence[RunTimeConstant]) -> None:
    """Raises InputError where what follows from constants within their bounds is no number, or none of a float."""
    for values in ({}, *({c.path: end} for c in constants for end in (c.low, c.high))):
        given = [values.get(c.path, c.default) for c in constants]
        derived = derived_values(members, given, Real.FLOAT)
        if not np.all(np.isfinite(derived)):
            where = ", ".join(
                f"{c.path} = {c.shown(v)}" for c, v in zip(constants, given, strict=True) if c.path in values
            )
            what = f"the controller cannot be computed at {where or 'the file numbers'}; narrow its bounds"
            raise InputError(kernels.model.name, [Fault("run_time.constants", what)])


def start_calls(context: Mapping[str, Any]) -> Iterable[str]:
    """The elementary functions that are called when the C starts."""
    return context["derive"].calls if context["derive"] else ()
