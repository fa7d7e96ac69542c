"""B A^-1 of symbolic matrices against NumPy's."""

import casadi as ca
import numpy as np
import pytest

from ctrlgen.numerics.right_division import over


def arrow(n: int, core: int) -> np.ndarray:
    """Which entries a matrix of `core` coupled rows has beside rows that are coupled with these alone."""
    entries = np.eye(n, dtype=bool)
    entries[:core] = entries[:, :core] = True
    return entries


def compared(entries: np.ndarray, rng: np.random.Generator) -> ca.Function:
    """B A^-1 as a function of B and A, once its values are those of NumPy."""
    n = len(entries)
    A = np.where(entries, rng.standard_normal((n, n)), 0.0) + 4.0 * n * np.eye(n)
    order = rng.permutation(n)
    A, B = A[np.ix_(order, order)], rng.standard_normal((3, n))
    given = ca.MX.sym("B", 3, n), ca.MX.sym("A", ca.sparsify(ca.DM(A)).sparsity())
    f = ca.Function("f", list(given), [over(*given)])
    assert np.allclose(f(B, ca.sparsify(ca.DM(A))).full(), B @ np.linalg.inv(A), rtol=0, atol=1e-12)
    return f


@pytest.mark.parametrize("n", [1, 3, 6, 7, 9, 14])
@pytest.mark.parametrize("share", [0.0, 0.1, 0.4, 1.0])
def test_it_is_that_of_any_pattern(n, share):
    rng = np.random.default_rng(n)
    compared(rng.random((n, n)) < share, rng)


@pytest.mark.parametrize("n, core", [(12, 1), (12, 3), (20, 6)])
def test_many_rows_that_follow_few_are_written_out_by_their_entries(n, core):
    f = compared(arrow(n, core), np.random.default_rng(core))
    assert f.expand().n_instructions() > 0  # what is solved at run time cannot be


def test_rows_that_are_all_coupled_are_solved_at_run_time():
    f = compared(np.ones((8, 8), dtype=bool), np.random.default_rng(1))
    with pytest.raises(RuntimeError):
        f.expand()


@pytest.mark.parametrize("stiff", [1e2, 1e5, 1e8])
def test_what_is_stiff_and_stable_keeps_its_digits(stiff):
    """Contacts on one body, far stiffer together than each state follows alone: minors cancel there, and pivots do not."""
    rng, n = np.random.default_rng(5), 5
    s = rng.uniform(0.5, 2.0, n)
    A, B = np.eye(n) + stiff * np.outer(s, s), rng.standard_normal((4, n))
    given = ca.MX.sym("B", 4, n), ca.MX.sym("A", n, n)
    X = ca.Function("f", list(given), [over(*given)])(B, A).full()
    size = np.abs(X) @ np.abs(A) + np.abs(B)
    # backward error of n steps of elimination; minors miss it by some thousand times at 1e5
    assert np.all(np.abs(X @ A - B) < 4 * n * np.finfo(float).eps * size)
