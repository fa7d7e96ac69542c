"""CasADi functions mapped over samples, on NumPy's own memory: `Function.__call__` goes through a Python list of numbers."""

from __future__ import annotations

import casadi as ca
import numpy as np


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
            buffer.set_arg(i, memoryview(value.ravel()))
    results = [np.empty((mapped.size2_out(i), mapped.size1_out(i))) for i in range(mapped.n_out())]
    for i, value in enumerate(results):
        if value.size != mapped.nnz_out(i):
            raise ValueError(f"{mapped.name_out(i)} is not dense")
        if value.size:
            buffer.set_res(i, memoryview(value.ravel()))
    run()
    return results
