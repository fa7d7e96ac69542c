"""CasADi functions mapped over samples, on NumPy's own memory: `Function.__call__` goes through a Python list of numbers."""

from __future__ import annotations

import casadi as ca
import numpy as np

BLOCK = 500  # samples


def evaluate(mapped: ca.Function, *given: np.ndarray) -> list[np.ndarray]:
    """The results of `f.map(n)` or `f.mapaccum(n)`, dense.

    An argument that f takes as (rows,) is given as (n, rows), a result (rows, columns) returned as (n columns, rows): the
    order in which CasADi stores them, sample after sample.
    """
    buffer, run = mapped.buffer()
    kept = [np.ascontiguousarray(value, float) for value in given]
    for i, value in enumerate(kept):
        if value.size != mapped.nnz_in(i):
            raise ValueError(f"{mapped.name_in(i)}: {value.size} numbers, not {mapped.nnz_in(i)}")
        if value.size:
            buffer.set_arg(i, value.ravel().data)
    results = [np.empty((mapped.size2_out(i), mapped.size1_out(i))) for i in range(mapped.n_out())]
    for i, value in enumerate(results):
        if value.size != mapped.nnz_out(i):
            raise ValueError(f"{mapped.name_out(i)} is not dense")
        if value.size:
            buffer.set_res(i, value.ravel().data)
    run()
    return results


class Recursion:
    """`one` (state, inputs ...) -> (state after, result), sample after sample.

    CasADi takes longer to unroll a long recursion than to run it, so a block of it is unrolled and run again and again.
    """

    def __init__(self, one: ca.Function) -> None:
        self.one = one
        self.unrolled: dict[int, ca.Function] = {}

    def run(self, state: np.ndarray, *inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The state after each of n samples (n, n_s) and the results (n, n_r) for inputs (n, .)."""
        n = len(inputs[0])
        size = min(n, BLOCK)
        if size not in self.unrolled:
            self.unrolled[size] = self.one.mapaccum(size)
        states, results = np.empty((n, self.one.size1_out(0))), np.empty((n, self.one.size1_out(1)))
        for a in range(0, n, size):
            b = min(a + size, n)
            block = [np.concatenate([x[a:b], np.repeat(x[b - 1 : b], a + size - b, axis=0)]) for x in inputs]
            after, found = evaluate(self.unrolled[size], state, *block)
            states[a:b], results[a:b], state = after[: b - a], found[: b - a], after[-1]
        return states, results
