"""CasADi functions evaluated over many samples, directly on NumPy's memory.

`Function.__call__` converts every number through a Python list; `Function.buffer` does not.
"""

from __future__ import annotations

import time
from functools import lru_cache

import casadi as ca
import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.numerics.compiled import Compilable

BLOCK = 500  # samples of an unrolled recursion: CasADi takes longer to unroll a long one than to run it
# Times that a recursion will yet run over as many samples: a trial takes eight steps, some of them with further tries. Judgement.
LIKELY_RUNS = 4


def evaluate(batched: ca.Function, *given: np.ndarray) -> list[np.ndarray]:
    """The results of `f.map(n)` or `f.mapaccum(n)`.

    An argument that f takes as (rows,) is given as (n, rows); a result (rows, columns) of f is returned as (n columns, rows),
    the order in which CasADi stores it. Raises ValueError for an argument of the wrong size or a result that is not dense.
    """
    buffer, run = batched.buffer()
    arguments = [np.ascontiguousarray(value, float) for value in given]
    for i, value in enumerate(arguments):
        if value.size != batched.nnz_in(i):
            raise ValueError(
                f"argument {batched.name_in(i)} has {number_of(value.size, 'number')} instead of {batched.nnz_in(i)}"
            )
        if value.size:
            buffer.set_arg(i, value.ravel().data)
    results = [np.empty((batched.size2_out(i), batched.size1_out(i))) for i in range(batched.n_out())]
    for i, value in enumerate(results):
        if value.size != batched.nnz_out(i):
            raise ValueError(f"result {batched.name_out(i)} is not dense")
        if value.size:
            buffer.set_res(i, value.ravel().data)
    run()
    return results


class QuickCall:
    """A function with one result (n,), called for one set of arguments: they are written to memory that it keeps, which takes a tenth
    of the time of `Function.__call__` where a function is short."""

    def __init__(self, function: ca.Function) -> None:
        if function.nnz_out(0) < function.numel_out(0):
            symbols = [ca.SX.sym(name, *function.size_in(name)) for name in function.name_in()]
            function = ca.Function(function.name(), symbols, [ca.densify(function(*symbols))])
        self._buffer, self._run = function.buffer()
        self._given = [np.zeros(function.nnz_in(i)) for i in range(function.n_in())]
        self._result = np.zeros(function.nnz_out(0))
        for i, value in enumerate(self._given):
            if value.size:
                self._buffer.set_arg(i, value.data)
        if self._result.size:
            self._buffer.set_res(0, self._result.data)

    def __call__(self, *arguments: object) -> np.ndarray:
        """The result (n,) at `arguments`, each a number for all of its elements or an array of them."""
        for own, value in zip(self._given, arguments, strict=True):
            own[:] = value
        self._run()
        return self._result.copy()


@lru_cache(maxsize=128)  # the kernels of some controllers
def quick(function: ca.Function) -> QuickCall:
    """`QuickCall` of a function, made once."""
    return QuickCall(function)


class Recursion:
    """The recursion `one` (state, inputs ...) -> (next state, result), sample after sample: in unrolled blocks by CasADi's virtual
    machine, in one loop where it has been compiled. Without a state it is a map. It is unrolled over `block` samples, and is likely to
    run `likely_runs` times more over as many."""

    def __init__(self, one: ca.Function, block: int = BLOCK, likely_runs: float = LIKELY_RUNS) -> None:
        self.one, self.block, self.likely_runs = Compilable(one), block, likely_runs
        self.unrolled: dict[int, ca.Function] = {}

    def run(self, state: np.ndarray, *inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """States (n, n_s) after each of n samples and results (n, n_r), from `state` (n_s,) and inputs (n, .), or (1, .) where they are
        constant."""
        n = max(map(len, inputs))
        if self.one.is_compiled:
            return self.one.run(state, inputs, n)
        one, size = self.one.function, min(n, self.block)
        if size not in self.unrolled:
            self.unrolled[size] = one.mapaccum(size) if one.numel_out(0) else one.map(size)
        states, results = np.empty((n, one.size1_out(0))), np.empty((n, one.size1_out(1)))
        for a in range(0, n, size):
            begin = time.process_time()
            b = min(a + size, n)
            # the last block is filled with its last sample
            block = [_block(x, a, b, size) for x in inputs]
            after, values = evaluate(self.unrolled[size], state, *block)
            states[a:b], results[a:b], state = after[: b - a], values[: b - a], after[-1]
            seconds = time.process_time() - begin
            if self.one.spent(seconds, b - a, int((n - b) + self.likely_runs * n)):
                self.unrolled.clear()
                if b < n and self.one.is_compiled:
                    rest = [x[b:] if len(x) == n else x for x in inputs]
                    states[b:], results[b:] = self.one.run(state, rest, n - b)
                    break
        return states, results


def in_blocks(one: ca.Function, state: np.ndarray, given: np.ndarray) -> np.ndarray:
    """The states (n, n_s) after each of n steps of `one` (state, given) -> state, from `state` (n_s,) under `given` (n, .).

    By CasADi's virtual machine, in unrolled blocks, so that the memory that it takes does not grow with n; raises what `one` raises.
    """
    states = np.empty((len(given), len(state)))
    for a in range(0, len(given), BLOCK):
        block = given[a : a + BLOCK]
        (states[a : a + BLOCK],) = evaluate(one.mapaccum(len(block)), state, block)
        state = states[a + len(block) - 1]
    return states


def _block(x: np.ndarray, a: int, b: int, size: int) -> np.ndarray:
    """Rows a to b of x, or the one row of what is constant, filled up to `size` rows with the last."""
    if len(x) == 1:
        return np.repeat(x, size, axis=0)
    return np.concatenate([x[a:b], np.repeat(x[b - 1 : b], a + size - b, axis=0)])
