"""Vectors with named components for the functions of a user's device, and the evaluation of those functions."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeAlias

import casadi as ca

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault
from ctrlgen.core.names import meant

Law: TypeAlias = Callable[..., Any] | ca.Function


class Ports:
    """A vector with named components, SI: `u.motor`, `u["motor"]` and `u[0]` are one, `u.vector` (n,) is all of them."""

    def __init__(self, what: str, names: Sequence[str], vector: ca.SX) -> None:
        self.what, self.names, self.vector = what, tuple(names), vector

    def __getattr__(self, name: str) -> ca.SX:
        if name.startswith("__") or name in ("names", "what", "vector"):
            raise AttributeError(name)
        if name not in self.names:
            raise AttributeError(f"{self.what} has no {name!r}; {suggestion(name, self.names)}")
        return self.vector[self.names.index(name)]

    def __getitem__(self, key: str | int) -> ca.SX:
        return getattr(self, key) if isinstance(key, str) else self.vector[range(len(self.names))[key]]

    def __iter__(self) -> Iterator[ca.SX]:
        return (self.vector[i] for i in range(len(self.names)))

    def __len__(self) -> int:
        return len(self.names)


def suggestion(name: str, names: Sequence[str]) -> str:
    """'did you mean ...?' for a name that is not one of `names`, or the list of them."""
    return meant(name, names, f"it has {', '.join(names) or 'nothing'}")


def evaluate_law(where: str, law: Law, offered: Mapping[str, Ports], names: Sequence[str]) -> tuple[ca.SX, list[Fault]]:
    """(vector, faults): what `law` returns for the vectors `offered`, one component for each of `names`; zeros where it has faults.

    A Python function is given the vectors that its arguments name, a `ca.Function` those that its inputs name; an input
    may also have the name of one parameter. `where` is the law's name in the faults.
    """
    nothing = ca.SX.zeros(len(names), 1)
    try:
        read: Callable[..., tuple[list[ca.SX], list[Fault]]] = _inputs if isinstance(law, ca.Function) else _arguments
        given, faults = read(where, law, offered)
    except (TypeError, ValueError) as error:
        return nothing, [Fault(where, f"is not a function that can be called: {error}")]
    if faults:
        return nothing, faults
    try:
        value = law(*given)
    except Exception as error:  # a user's code may raise anything
        lines = str(error).strip().splitlines()
        return nothing, [Fault(where, f"raised {type(error).__name__}: {lines[-1] if lines else 'no message'}")]
    if isinstance(law, ca.Function) and law.n_out() != 1:
        return nothing, [Fault(where, f"{law.name()} has {number_of(law.n_out(), 'output')}; give a function with one")]
    rows, faults = _rows(where, value, names)
    if not faults:
        known = {s.element_hash() for ports in offered.values() for s in ca.symvar(ports.vector)}
        foreign = sorted({s.name() for s in ca.symvar(rows) if s.element_hash() not in known})
        faults = [Fault(where, f"contains the symbol {name!r}, which is not one of its arguments") for name in foreign]
    return (nothing, faults) if faults else (rows, [])


def _arguments(where: str, law: Callable[..., Any], offered: Mapping[str, Ports]) -> tuple[list[Ports], list[Fault]]:
    """(vectors, faults): the vectors that the arguments of a Python function name."""
    refused = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    wanted = [
        q
        for q in inspect.signature(law).parameters.values()
        if q.default is inspect.Parameter.empty or q.name in offered
    ]
    unknown = [q.name for q in wanted if q.name not in offered or q.kind in refused]
    known = ", ".join(offered)
    faults = [Fault(where, f"has an argument {name!r}; its arguments may be {known}") for name in unknown]
    return [offered[q.name] for q in wanted if q.name in offered], faults


def _inputs(where: str, law: ca.Function, offered: Mapping[str, Ports]) -> tuple[list[ca.SX], list[Fault]]:
    """(values, faults): the vectors or parameters that the inputs of a CasADi function name."""
    given, faults, numbers = [], [], offered["p"]
    for i in range(law.n_in()):
        name, size = law.name_in(i), law.size_in(i)
        if name in offered:
            value, listed = offered[name].vector, f" ({', '.join(offered[name].names)})"
        elif name in numbers.names:
            value, listed = numbers[name], ""
        else:
            what = f"has an input {name!r}; name its inputs {', '.join(offered)} or as a parameter: {', '.join(numbers.names)}"
            faults.append(Fault(where, f"{law.name()} {what}"))
            continue
        if size != (value.numel(), 1):
            what = f"input {name!r} of {law.name()} is {size[0]} x {size[1]}, and {name} has {value.numel()}{listed}"
            faults.append(Fault(where, what))
        given.append(value)
    return given, faults


def _rows(where: str, value: Any, names: Sequence[str]) -> tuple[ca.SX, list[Fault]]:
    """(vector (len(names),), faults) from what a law returned: a mapping by name, a vector, a list or one number."""
    nothing = ca.SX.zeros(len(names), 1)
    if isinstance(value, Mapping):
        faults = [
            Fault(where, f"returns {k!r}, which is not one of its components; {suggestion(str(k), names)}")
            for k in value
            if k not in names
        ]
        faults += [Fault(where, f"returns no {name!r}") for name in names if name not in value]
        if faults:
            return nothing, sorted(faults, key=str)
        value = [value[name] for name in names]
    if isinstance(value, Ports):
        value = value.vector
    if isinstance(value, ca.MX):
        return nothing, [Fault(where, "returns MX; build the expression from its arguments, which are SX")]
    try:
        parts = [value] if isinstance(value, (ca.SX, ca.DM, int, float)) else list(value)
        rows = ca.densify(ca.vertcat(ca.SX(0, 1), *(ca.vec(ca.SX(part)) for part in parts)))
    except (TypeError, NotImplementedError, RuntimeError):
        return nothing, [
            Fault(
                where, f"returns {type(value).__name__}; return {number_of(len(names), 'number')}: {', '.join(names)}"
            )
        ]
    if rows.numel() != len(names):
        return nothing, [
            Fault(where, f"returns {number_of(rows.numel(), 'number')}; {len(names)} needed: {', '.join(names)}")
        ]
    return rows, []
