"""Functions compiled to machine code: the same numbers to the last bit, kept in the cache, and none where there is no compiler."""

from __future__ import annotations

import platform

import casadi as ca
import numpy as np
import pytest

from ctrlgen.numerics import batched_evaluation, compiled, generated_c
from ctrlgen.numerics.batched_evaluation import BLOCK, Recursion, evaluate, in_blocks, quick
from ctrlgen.numerics.compiled import Compilable

LONG, MANY = 1e6, 10_000  # seconds that would pay for any compilation, and samples for writing the code


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("CTRLGEN_NO_COMPILER", raising=False)
    compiled.compiler.cache_clear()
    yield tmp_path / "ctrlgen"
    compiled.compiler.cache_clear()


def friction():
    """A step with a state, a corner and transcendental functions."""
    z, v, p = ca.SX.sym("z"), ca.SX.sym("v"), ca.SX.sym("p", 2)
    after = z + p[0] * (v - z * ca.fabs(v) / p[1])
    return ca.Function("one", [z, v, p], [after, ca.vertcat(ca.tanh(after), ca.exp(-after) * v)])


def test_steps_in_blocks_are_those_of_one_call_after_the_other():
    state, given = ca.MX.sym("state", 2), ca.MX.sym("given")
    one = ca.Function("one", [state, given], [ca.vertcat(ca.cos(state[1]) + given, state[0] * given)])
    drive = np.random.default_rng(2).standard_normal((2 * BLOCK + 3, 1))
    found, now = in_blocks(one, np.array([0.1, 0.2]), drive), np.array([0.1, 0.2])
    for value, row in zip(drive, found, strict=True):
        now = one(now, value).full().ravel()
        assert np.array_equal(now, row)


def test_a_quick_call_gives_the_numbers_of_an_ordinary_one_and_keeps_none():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y")
    f = ca.Function("f", [x, y], [ca.vertcat(x[1] / y, ca.SX(1, 1), ca.sin(x[0]))])  # with a structural zero
    first = quick(f)(np.array([0.3, 0.7]), 3.0)
    second = quick(f)(np.array([1.0, 2.0]), np.array([5.0]))
    assert np.array_equal(first, f([0.3, 0.7], 3.0).full().ravel()) and np.array_equal(
        second, f([1, 2], 5).full().ravel()
    )


def test_library_gives_the_numbers_of_the_virtual_machine_to_the_last_bit(cache):
    if compiled.compiler() is None:
        pytest.skip("no C compiler here")
    rng = np.random.default_rng(1)
    v, p = rng.standard_normal((1700, 1)), np.tile([0.3, 0.7], (1700, 1))
    plain = Recursion(friction()).run(np.zeros(1), v, p)
    quick = Recursion(friction())
    quick.run(np.zeros(1), v, p)
    assert quick.one.spent(LONG, MANY)
    quick.unrolled.clear()
    for a, b in zip(plain, quick.run(np.zeros(1), v, p), strict=True):
        assert np.array_equal(a, b)
    assert len(list(cache.glob("*.so"))) == 1


def test_what_decays_below_the_least_normal_number_is_zero_in_the_library_and_nowhere_else(cache):
    if compiled.compiler() is None:
        pytest.skip("no C compiler here")
    state, given = ca.SX.sym("state"), ca.SX.sym("given")
    one = Compilable(ca.Function("one", [state, given], [0.5 * state + given, 2 * state]))
    assert one.spent(LONG, MANY)
    least = np.finfo(float).tiny
    states, _ = one.run(np.array([1.0]), [np.zeros((1100, 1))], 1100)
    normal = 0.5 ** np.arange(1, 1101) >= least
    assert np.array_equal(states[normal, 0], 0.5 ** np.arange(1, 1101)[normal])
    if platform.machine() == "x86_64":
        assert not states[~normal].any()
    assert np.array([least])[0] / 4 > 0


def test_without_a_state_it_is_a_map_before_and_after_it_is_compiled(cache):
    a, b = ca.SX.sym("a", 2), ca.SX.sym("b")
    one = ca.Function("one", [ca.SX.sym("none", 0), a, b], [ca.SX(0, 1), ca.vertcat(a[0] * b, ca.sin(a[1]))])
    rows = np.random.default_rng(5).standard_normal((1700, 2))
    wanted = np.column_stack([3.0 * rows[:, 0], one.map(1700)(ca.DM(0, 1700), rows.T, 3.0)[1].full()[1]])
    quick = Recursion(one, block=501)
    states, results = quick.run(np.zeros(0), rows, np.array([[3.0]]))
    assert states.shape == (1700, 0) and np.array_equal(results, wanted)
    if compiled.compiler() is None:
        pytest.skip("no C compiler here")
    assert quick.one.is_compiled or quick.one.spent(LONG, MANY)
    assert np.array_equal(quick.run(np.zeros(0), rows, np.array([[3.0]]))[1], wanted)


def test_same_function_is_compiled_once(cache, monkeypatch):
    if compiled.compiler() is None:
        pytest.skip("no C compiler here")
    assert Compilable(friction()).spent(LONG, MANY)
    monkeypatch.setattr(compiled.subprocess, "run", lambda *_, **__: pytest.fail("compiled again"))
    assert Compilable(friction()).spent(0.21, MANY)  # a library that is there costs nothing


def test_function_that_hardly_runs_is_not_compiled(cache):
    short = Compilable(friction())
    assert not short.spent(1e-3, MANY)
    assert not cache.exists()


def test_what_runs_in_less_than_its_c_takes_to_write_is_not_written(cache, monkeypatch):
    """Hundreds of candidate models of a hexapod run over some poses each: writing their C took a third of a diagnosis, for nothing."""
    if compiled.compiler() is None:
        pytest.skip("no C compiler here")
    written = []

    def c_code(function):
        written.append(function)
        raise ValueError

    monkeypatch.setattr(compiled, "c_code", c_code)
    poses = 100
    few = Compilable(friction())
    assert not few.spent(1.0, poses, compiled.SAMPLES_TO_WRITE - 2 * poses) and not written
    few.spent(1.0, poses, compiled.SAMPLES_TO_WRITE - 2 * poses)
    assert len(written) == 1


def test_without_a_compiler_nothing_changes(cache, monkeypatch):
    monkeypatch.setenv("CTRLGEN_NO_COMPILER", "1")
    compiled.compiler.cache_clear()
    function = friction()
    slow = Compilable(function)
    assert not slow.spent(LONG, MANY)
    assert slow.function is function


def test_failing_compiler_leaves_the_virtual_machine(cache, monkeypatch):
    monkeypatch.setattr(compiled, "FLAGS", ("--no-such-flag",))
    broken = Compilable(friction())
    if compiled.compiler() is not None:
        assert not broken.spent(LONG, MANY)
        assert not list(cache.glob("*.so"))
        assert not broken.spent(LONG, MANY)


def test_a_long_function_is_compiled_in_parts_and_gives_the_same_bits(cache, monkeypatch):
    """Three calls of it in one function: the part that only computes is cut, what calls it is left as it is. The first values are read
    again in the last part, and in none between."""
    if compiled.compiler() is None:
        pytest.skip("no C compiler here")
    x = ca.SX.sym("x", 3)
    y = first = ca.exp(-x * x)
    for k in range(200):
        y = ca.vertcat(ca.sin(y[1]) + y[2] / (k + 1), y[0] * y[1] - 0.5 * y[2], ca.cos(y[0] * y[0]))
    step, at, by = ca.Function("step", [x], [y + first]), ca.MX.sym("at", 3), ca.MX.sym("by")
    after = step(step(at)) + by * step(2 * at)
    whole = ca.Function("whole", [at, by], [after, ca.sum1(after)])
    monkeypatch.setattr(generated_c, "LARGE", 1000)
    code = generated_c.c_code(whole)
    assert 2 <= code.count("__attribute__((noinline)) static void casadi_f") <= 10
    assert_same_bits(whole, np.array([0.1, -0.2, 0.3]), np.random.default_rng(2).standard_normal((20, 1)))


@pytest.mark.parametrize("rows", [*range(1, 27), 40])
def test_products_of_full_matrices_have_the_bits_of_the_virtual_machine(cache, rows):
    """Of any number of rows, by columns with no entry, one and several; what is not written to stays as it is."""
    if compiled.compiler() is None:
        pytest.skip("no C compiler here")
    rng = np.random.default_rng(rows)
    by = rng.standard_normal((5, 7)) * (rng.random((5, 7)) < 0.4)
    by[:, 2], by[:, 4] = 0.0, 1.0
    state, p = ca.MX.sym("state", 5 * rows), ca.MX.sym("p", rows)
    X = ca.reshape(state, rows, 5)
    Z = ca.mac(X, ca.MX(ca.sparsify(ca.DM(by))), ca.repmat(p, 1, 7))
    after = ca.mac(Z, ca.MX(ca.sparsify(ca.DM(by.T))), ca.DM.zeros(rows, 5))
    one = ca.Function(
        "one", [state, p], [ca.vec(after) / (1 + ca.sumsqr(after)), ca.vertcat(ca.vec(Z), ca.vec(after), ca.vec(X))]
    )
    assert "casadi_four" in generated_c.c_code(one)
    assert_same_bits(one, rng.standard_normal(5 * rows), rng.standard_normal((9, rows)))


OF_ONE = (
    *(
        "sqrt",
        "exp",
        "log",
        "log1p",
        "expm1",
        "sin",
        "cos",
        "tan",
        "asin",
        "acos",
        "atan",
        "sinh",
        "cosh",
        "tanh",
        "asinh",
        "acosh",
    ),
    *("atanh", "erf", "floor", "ceil", "fabs", "sign"),
)
OF_TWO = (
    *(
        "fmin",
        "fmax",
        "atan2",
        "hypot",
        "copysign",
        "fmod",
        "remainder",
        "power",
        "lt",
        "le",
        "eq",
        "ne",
        "logic_and",
        "logic_or",
    ),
    "if_else",
)


def test_every_operation_has_the_bits_of_the_virtual_machine_and_is_declared(cache, monkeypatch):
    """At numbers that no operation can be evaluated at too: what a header declares in front of CasADi's code, the code declares itself."""
    if compiled.compiler() is None:
        pytest.skip("no C compiler here")
    flags = ["-Werror=implicit-function-declaration" if flag == "-w" else flag for flag in compiled.FLAGS]
    monkeypatch.setattr(compiled, "FLAGS", (*flags, "-Wno-unused"))
    for symbol in (ca.SX, ca.MX):
        s, a, b = (symbol.sym(name) for name in "sab")
        two = [getattr(ca, name)(a, b, *([0] if name == "if_else" else [])) for name in OF_TWO]
        others = [1 / a, a * a, 2 * a, -a, ca.logic_not(a), symbol(np.inf) * a, symbol(np.nan) + a]
        values = ca.vertcat(*(getattr(ca, name)(a) for name in OF_ONE), *two, *others)
        one = ca.Function("one", [s, a, b], [s + b, values])
        rows = np.array([-np.inf, -1.5, -1.0, -0.3, -0.0, 0.0, 0.4, 1.0, 2.5, np.inf, np.nan])
        assert_same_bits(one, np.zeros(1), np.repeat(rows, len(rows))[:, None], np.tile(rows, len(rows))[:, None])


def assert_same_bits(one, state, *inputs):
    """States and results of the library are those of the virtual machine, whatever the sign of a zero; any two NaN are the same."""
    slow, library = Recursion(one), Compilable(one)
    slow.one.settled = True
    assert library.spent(LONG, MANY)
    for a, b in zip(slow.run(state, *inputs), library.run(state, inputs, len(inputs[0])), strict=True):
        assert np.array_equal(a, b, equal_nan=True) and np.array_equal(np.signbit(a[a == 0]), np.signbit(b[b == 0]))


def test_a_damaged_library_leaves_the_virtual_machine(cache):
    if compiled.compiler() is None:
        pytest.skip("no C compiler here")
    cache.mkdir()
    (cache / compiled.library_name(generated_c.c_code(friction()))).write_bytes(b"no library")
    broken = Recursion(friction())
    assert not broken.one.spent(LONG, MANY)
    assert broken.run(np.zeros(1), np.ones((3, 1)), np.array([[0.3, 0.7]]))[0].shape == (3, 1)


def test_a_constant_input_is_given_once_and_one_of_another_length_is_refused(cache):
    rng = np.random.default_rng(3)
    v, p = rng.standard_normal((1200, 1)), np.array([[0.3, 0.7]])
    plain, quick = Recursion(friction()), Recursion(friction())
    expected = plain.run(np.zeros(1), v, np.repeat(p, 1200, axis=0))
    for a, b in zip(expected, quick.run(np.zeros(1), v, p), strict=True):
        assert np.array_equal(a, b)
    if compiled.compiler() is None:
        pytest.skip("no C compiler here")
    assert quick.one.is_compiled or quick.one.spent(LONG, MANY)
    for a, b in zip(expected, quick.run(np.zeros(1), v, p), strict=True):
        assert np.array_equal(a, b)
    for wrong in (p[:, :1], np.repeat(p, 3, axis=0)):
        with pytest.raises(ValueError, match="has"):
            quick.run(np.zeros(1), v, wrong)


def test_a_long_record_is_compiled_for_after_its_first_block(cache, monkeypatch):
    """Seconds are told by a clock that goes on a tenth at each look: the rest and a few more records would take longer than to compile."""
    if compiled.compiler() is None:
        pytest.skip("no C compiler here")
    clock = iter(0.1 * np.arange(1000))
    monkeypatch.setattr(batched_evaluation.time, "process_time", lambda: next(clock))
    blocks = []
    monkeypatch.setattr(batched_evaluation, "evaluate", lambda *given: blocks.append(1) or evaluate(*given))
    v, p = np.random.default_rng(4).standard_normal((1700, 1)), np.array([[0.3, 0.7]])
    quick = Recursion(friction())
    got = quick.run(np.zeros(1), v, p)
    assert quick.one.is_compiled and len(blocks) == 1
    slow = Recursion(friction())
    monkeypatch.setattr(slow.one, "spent", lambda *_: False)
    for a, b in zip(got, slow.run(np.zeros(1), v, p), strict=True):
        assert np.array_equal(a, b)
