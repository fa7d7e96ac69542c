"""The terms of laws, written down and compiled once for all structures of a device: what a law reads is a symbol here.

A law is the same expression in every structure; what it reads of the model differs. `LawTerms` therefore gives each signal
that a law reads a symbol of its own, and `values_read` evaluates those signals for one structure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any, Self

import casadi as ca
import numpy as np

from ctrlgen.effects import Effect, LawInputs, Place
from ctrlgen.estimation.settings import CANDIDATE_TERMS
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.model.model import Model
from ctrlgen.numerics.batched_evaluation import Recursion
from ctrlgen.numerics.phi_functions import lag_increment, phi_matrices
from ctrlgen.recordings.recording import Timing

NONE = ca.SX(0, 1)


@dataclass(frozen=True)
class Read:
    """A signal that a law reads: the attribute `name` of its inputs on channel `index` of `place`, after the effects of lower
    `order` there."""

    place: Place
    order: int
    index: int
    name: str

    def of(self, model: Model) -> ca.SX:
        """The expression of the signal in a `model` that is not closed yet."""
        value = getattr(model.law_inputs(self.place, self.index, None, {}, self.order), self.name)
        return ca.SX(value() if callable(value) else value)


class _SymbolicInputs(LawInputs):
    """What a law may read, with a symbol of `terms` in place of each expression of the model that it does read; None and numbers as
    they are."""

    def __init__(self, terms: LawTerms, place: Place, order: int, actual: LawInputs, states: dict[str, ca.SX]) -> None:
        vars(self).update(states=SimpleNamespace(**states), _model=(terms, place, order, actual))

    def __getattribute__(self, name: str) -> Any:
        if name.startswith("_") or name in {"states", "with_states"}:
            return object.__getattribute__(self, name)
        terms, place, order, actual = self._model
        value = getattr(actual, name)
        if callable(value):
            return lambda: terms.symbol(Read(place, order, actual.index, name), value())
        return terms.symbol(Read(place, order, actual.index, name), value) if isinstance(value, ca.SX) else value

    def with_states(self, states: Mapping[str, ca.SX]) -> Self:
        other = object.__new__(type(self))
        vars(other).update(vars(self) | {"states": SimpleNamespace(**{**vars(self.states), **states})})
        return other


@dataclass(frozen=True, eq=False)
class LawTerm:
    """One law at one place: the `slope` of its term by the amplitude at `off`, or from there to a finite amplitude, times a step
    of the amplitude; with the symbols of its states, their rates and new values (`stepped`, None where a state is not). Those `settle` that
    time alone brings to rest: neither clocks, nor what a contact keeps, nor what differs by record unless the law says where it rests."""

    kind: str
    slope: ca.SX
    off: float
    states: tuple[ca.SX, ...]
    rates: tuple[ca.SX, ...]
    stepped: tuple[ca.SX | None, ...]
    clocks: tuple[bool, ...]
    settle: tuple[bool, ...]

    @cached_property
    def reads(self) -> frozenset[str]:
        """The names of all symbols in the slope."""
        return frozenset(s.name() for s in ca.symvar(self.slope))

    def after(self, sample_time: float) -> ca.SX:
        """The states after a sample: linear ones exactly, stepped ones by their update."""
        if not self.states:
            return NONE
        settled = not np.isfinite(sample_time)
        h = CANDIDATE_TERMS.settled_time if settled else sample_time
        memory, rates = ca.vertcat(*self.states), ca.vertcat(*self.rates)
        A = ca.jacobian(rates, memory)
        if not ca.symvar(A):
            step = h * ca.DM(phi_matrices(h * ca.DM(A).full(), 1)[1]) @ rates
        elif all(row == column for row, column in zip(*A.sparsity().get_triplet(), strict=True)):
            step = lag_increment(ca.diag(A), [rates], h)
        else:
            step = h * rates
        changes = zip(self.states, self.stepped, self.clocks, ca.vertsplit(step), strict=True)
        return ca.vertcat(
            *(
                new if new is not None else state + (1.0 if settled else h) if clock else state + change
                for state, new, clock, change in changes
            )
        )


class LawTerms:
    """The terms of laws along motions of one timing, of so many `samples` in all; `symbols` of what they read.

    What a law reads that is a number, such as a typical size, is that of the `described` device in every structure: a term is the
    same whichever structure needs it first.
    """

    def __init__(self, timing: Timing, described: Model, samples: int) -> None:
        self.timing, self.described, self.samples = timing, described, samples
        self.symbols: dict[Read, ca.SX] = {}
        self._terms: dict[tuple[Any, ...], LawTerm] = {}
        self._compiled: dict[tuple[Any, ...], CompiledTerms] = {}

    def symbol(self, read: Read, expression: ca.SX) -> ca.SX:
        """The symbol that stands for what is read."""
        if read not in self.symbols:
            self.symbols[read] = ca.SX.sym(f"r{len(self.symbols)}", *expression.shape)
        return self.symbols[read]

    def term(
        self,
        law: Effect,
        index: int,
        partner: int | None,
        shape: dict[str, float],
        off: float,
        size: float,
        finite: float,
    ) -> LawTerm:
        """The slope at `off`, or from there to the amplitude `finite`, times `size`."""
        key = (law.kind, index, partner, tuple(shape.items()), off, size, finite)
        if key not in self._terms:
            n = len(self._terms)
            states = {s.name: ca.SX.sym(f"m{n}_{s.name}") for s in law.states}
            a = ca.SX.sym("a")
            p = SimpleNamespace(**shape, **{law.amplitude().name: a})
            actual = self.described.law_inputs(law.place, index, partner, {}, law.order)
            new = law.after_sample(_SymbolicInputs(self, law.place, law.order, actual, states), p)
            s = _SymbolicInputs(self, law.place, law.order, actual, states | new)
            change = {state.name: ca.SX(float(state.clock)) for state in law.states} | law.rates(s, p)
            value, at = ca.SX(law.term(s, p)), finite or off
            rests = type(law).resting is not Effect.resting
            if finite:
                value = ca.substitute(value, a, finite) * (a - off) / (finite - off)
            self._terms[key] = LawTerm(
                law.kind,
                ca.substitute(ca.jtimes(value, a, size), a, off),
                off,
                tuple(states.values()),
                tuple(ca.substitute(ca.SX(change[state.name]), a, at) for state in law.states),
                tuple(ca.substitute(ca.SX(new[state.name]), a, at) if state.stepped else None for state in law.states),
                tuple(state.clock for state in law.states),
                tuple(not (s.clock or law.set_valued or (s.free and not rests)) for s in law.states),
            )
        return self._terms[key]

    def compiled(self, terms: Sequence[LawTerm], driven: Sequence[bool]) -> CompiledTerms:
        """`terms` as functions of what they read; those `driven` also at the end of a sample."""
        key = (tuple(terms), tuple(driven))
        if key not in self._compiled:
            self._compiled[key] = CompiledTerms(self, terms, driven)
        return self._compiled[key]


class CompiledTerms:
    """Terms of one kind as one function: (memory, read, read at the end of the sample) -> (memory after the sample, every term,
    those `driven` at its end). A pose is read with the memories at the end of its dwell.
    """

    def __init__(self, laws: LawTerms, terms: Sequence[LawTerm], driven: Sequence[bool]) -> None:
        memory = ca.vertcat(NONE, *(s for term in terms for s in term.states))
        after = ca.vertcat(NONE, *(term.after(laws.timing.sample_time) for term in terms))
        slopes = ca.vertcat(NONE, *(term.slope for term in terms))
        names = {s.name() for s in ca.symvar(ca.vertcat(slopes, after))}
        self.reads = [r for r, symbol in laws.symbols.items() if names & {s.name() for s in ca.symvar(symbol)}]
        read = ca.vertcat(NONE, *(laws.symbols[r] for r in self.reads))
        end = ca.SX.sym("end", read.numel())
        chosen = slopes[[k for k, is_driven in enumerate(driven) if is_driven]]
        (at_end,) = ca.substitute([chosen], [memory, read], [after, end]) if chosen.numel() else (NONE,)
        if laws.timing.poses:
            slopes = ca.substitute(slopes, memory, after)
        results = [ca.densify(value) for value in (after, ca.vertcat(slopes, at_end))]
        one = ca.Function("laws", [memory, read, end], results, {"cse": True})
        self._one = _in_blocks(one, CANDIDATE_TERMS.likely_screens * laws.samples)
        self._slopes = slopes.numel()

    def along(self, memory: np.ndarray, read: np.ndarray, end: np.ndarray) -> list[np.ndarray]:
        """Memories after each of n samples, terms and those at the end of the sample, (n, .) each, from `memory` on, of what is
        read at the samples (n, .) and at their ends."""
        after, terms = self._one.run(memory, read, end)
        return [after, terms[:, : self._slopes], terms[:, self._slopes :]]


def _in_blocks(one: ca.Function, samples: float) -> Recursion:
    """(state, given ...) -> (next state, result) along blocks of so many samples in all, with the sample after each block."""
    block = CANDIDATE_TERMS.block + 1
    return Recursion(one, block, samples / block)


class SignalsRead:
    """What the laws read of one structure: its signals at a sample and at its end, where the drive is what it was. `jumping` are
    the names of the symbols, of those given with what is read, whose signals jump with a held drive."""

    def __init__(self, simulator: Simulator, reads: Mapping[Read, ca.SX], samples: int) -> None:
        m = simulator.model
        S, S_next = ca.vertcat(m.x, m.z), ca.SX.sym("S_next", m.x.numel() + m.z.numel())
        values = [r.of(m) for r in reads]
        open_ = ca.vertcat(NONE, *(ca.densify(value) for value in values))
        end = ca.substitute(open_, S, S_next)
        ends = np.cumsum([0, *(value.numel() for value in values)])
        self.rows = {r: np.arange(a, b) for r, a, b in zip(reads, ends, ends[1:], strict=False)}
        jumping = ca.vertcat(m.u, m.held, m.heat)
        jumps = ca.which_depends(open_, jumping, 1, True) if open_.numel() else []
        names = [s.name() for symbol in reads.values() for s in ca.vertsplit(symbol)]
        self.jumping = frozenset(name for name, jump in zip(names, jumps, strict=True) if jump)
        given = [ca.SX.sym("none", 0), S, m.u, simulator.ambient, S_next, m.p]
        both = ca.densify(m.closed(ca.vertcat(open_, end)))
        # another structure has other signals: one screen
        self._one = _in_blocks(ca.Function("read", given, [NONE, both], {"cse": True}), samples)
        self._signals = open_.numel()

    def along(self, p: np.ndarray, *given: np.ndarray) -> list[np.ndarray]:
        """The signals (n, .) at n samples and at their ends, with the numbers `p`."""
        both = self._one.run(np.zeros(0), *given, p[None, :])[1]
        return [both[:, : self._signals], both[:, self._signals :]]

    def columns(self, reads: Sequence[Read]) -> np.ndarray:
        """The places of some signals among all."""
        return np.concatenate([np.zeros(0, int), *(self.rows[r] for r in reads)])
