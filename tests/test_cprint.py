"""Functions as C: what is printed computes what CasADi does, equal axes are one loop, numbers have names, laws are functions."""

from __future__ import annotations

import subprocess

import casadi as ca
import numpy as np
import pytest
from one_kernel import print_function

from ctrlgen.firmware.c.cprint import Law, Printer
from ctrlgen.firmware.c.elementary import elementary_text
from ctrlgen.firmware.c.expression_graph import GIVEN, Graph, Node, reached
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.toolchains import FLAGS

N = 4  # elements of each argument
STEPS = 3  # of the printed iterations


def random_law(rng: np.random.Generator, depth: int, numbers: bool = True):
    """A function of two numbers of order one, made of random operations that stay finite; with numbers of its own."""
    if depth == 0:
        pick, number = rng.integers(3), float(rng.uniform(-2, 2))
        return lambda a, b: (a, b, ca.SX(number))[pick]
    left, right = random_law(rng, depth - 1), random_law(rng, depth - 1)
    operation = (
        lambda x, y: x + y,
        lambda x, y: x - y,
        lambda x, y: 0.5 * x * y,
        lambda x, y: x / (1.5 + y * y),
        lambda x, y: ca.fmin(x, y),
        lambda x, y: ca.fmax(x, -y),
        lambda x, y: ca.sqrt(1 + x * x) - y,
        lambda x, y: ca.fabs(x) * 0.3 + y,
        lambda x, y: ca.sin(x) - 2 * y,
        lambda x, y: ca.if_else(x < y, x, 0.25 * y),
        lambda x, y: -(x + 0.7) * 3.0,
        lambda x, y: (0.1 + x * x) ** 1.5 / (2 + y * y),
    )[rng.integers(12)]
    return lambda a, b: operation(left(a, b), right(a, b))


def random_function(rng: np.random.Generator) -> ca.Function:
    """Rows of equal and of different form, with parts in common, over two arguments of `N` elements."""
    x, y = ca.SX.sym("x", N), ca.SX.sym("y", N)
    law, other, outer = (random_law(rng, int(rng.integers(1, 4))) for _ in range(3))
    matrix = ca.DM(rng.uniform(-1, 1, (N, N)).round(2))
    own = ca.vertcat(*(law(x[i], y[i]) for i in range(N)))
    mixed = ca.mtimes(matrix, own)
    tables = ca.vertcat(*(other(rng.uniform(1, 2) * x[i], y[0]) for i in range(N)))
    rows = (
        own,
        mixed,
        tables,
        ca.mtimes(matrix, x),
        ca.vertcat(*(outer(mixed[i], own[0]) for i in range(N))),
        ca.vertcat(*(outer(own[i // 2], tables[i]) for i in range(N))),
        ca.vertcat(x[3], x[0] + y[1], law(x[2], y[3]), 2.0),
        ca.vertcat(*(own[(i + 1) % N] - x[i] for i in range(N))),
    )[rng.integers(8)]
    return ca.Function("f", [x, y], [ca.densify(rows)], ["x", "y"], ["r"], {"cse": True})


def built(compiler: str, folder, text: str, body: str) -> np.ndarray:
    """The numbers that a program prints."""
    (folder / "f.c").write_text(
        f"#include <stdio.h>\n#include <stdint.h>\n{text}\nint main(void) {{ int k; {body} return 0; }}\n"
    )
    done = subprocess.run(
        [compiler, *FLAGS, str(folder / "f.c"), "-o", str(folder / "f")], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[:3000]
    return np.array(
        subprocess.run([folder / "f"], capture_output=True, text=True, check=True).stdout.split(), dtype=float
    )


def listed(values: np.ndarray) -> str:
    return "{ " + ", ".join(repr(float(v)) for v in values) + " }"


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 6))])
def test_random_functions_compute_what_casadi_does_also_in_place_and_iterated(compiler, tmp_path, seed):
    rng = np.random.default_rng(seed)
    texts, bodies, expected, calls = [], [], [], set()
    for k in range(40):
        f, printer = random_function(rng), Printer(Real.DOUBLE, {})
        x, y = rng.uniform(-1, 1, N), rng.uniform(-1, 1, N)
        plain, again = f(x, y).full().ravel(), x
        for _ in range(STEPS):
            again = f(again, y).full().ravel()
        if not np.all(np.abs(again) < 1e6):
            continue
        kernels = [
            printer.kernel(f, f"plain{k}"),
            printer.kernel(f, f"place{k}", may_be_result=["x", "y"]),
            printer.kernel(f, f"steps{k}", steps=("x", STEPS)),
        ]
        data = f"const double y[{N}] = {listed(y)}; double x[{N}] = {listed(x)}; double r[{N}];"
        for kernel, result in zip(kernels, ("r", "x", "r"), strict=True):
            show = f'for (k = 0; k < {N}; k++) {{ (void)printf("%.17g\\n", {result}[k]); }}'
            bodies.append(f"{{ {data} {kernel.call(result, x='x', y='y')}; {show} (void)x; (void)y; (void)r; }}")
        expected += [plain, plain, again]
        texts += [kernel.text for kernel in kernels]
        calls |= {name for kernel in kernels for name in kernel.calls}
    printed = built(compiler, tmp_path, elementary_text(calls, Real.DOUBLE) + "\n".join(texts), "\n".join(bodies))
    assert len(expected) >= 60
    wanted = np.concatenate(expected)  # some tens of roundings, three times over
    assert printed == pytest.approx(wanted, rel=1e-11, abs=1e-12)


def test_equal_axes_are_one_loop_and_what_differs_is_a_table():
    x = ca.SX.sym("x", 3)
    stiffness = [2.0, 3.0, 5.5]
    f = ca.Function(
        "f", [x], [ca.vertcat(*(k * ca.sqrt(1 + x[i] * x[i]) for i, k in enumerate(stiffness)))], ["x"], ["r"]
    )
    text = print_function(f, "f", Real.FLOAT).text
    assert text.count("square_root(") == 1 and "for (i = 0; i < 3; i++)" in text
    assert "[3] = { 2.0f, 3.0f, 5.5f };" in text


def test_a_matrix_is_a_table_with_one_row_a_line():
    x, A = ca.SX.sym("x", 3), np.array([[1, 2, 3], [4, 5, 6], [7, 8, 10.0]])
    text = print_function(ca.Function("f", [x], [ca.mtimes(A, x)], ["x"], ["r"]), "f", Real.FLOAT).text
    assert "{ 1.0f, 2.0f, 3.0f },\n" in text and "{ 7.0f, 8.0f, 10.0f }\n" in text


def decay(tau, time: float = 0.001):
    return 1 - ca.exp(-time / tau)


def test_a_number_that_comes_from_parameters_has_their_name_and_its_formula():
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p", 2)
    values = [0.005, 295.15]

    def law(tau, ambient):
        return x - decay(tau) * (x - ambient)

    plain = ca.Function("f", [x], [law(*values)], ["x"], ["r"])
    named = ca.Function("f", [x, p], [law(p[0], p[1])], ["x", "p"], ["r"])
    printer = Printer(Real.DOUBLE, {}, {"p": [(values[0], "actuator.time_constant"), (values[1], "actuator.ambient")]})
    text = printer.kernel(plain, "f", named=named).text
    assert "#define AMBIENT (295.15) /* actuator.ambient */" in printer.constants
    value = Real.DOUBLE.literal(float(decay(values[0])))
    assert f"({value}) /* 1 - exp((-0.001) / actuator.time_constant) */" in printer.constants
    assert "AMBIENT" in text and "TIME_CONSTANT_1" in text


def test_where_the_named_form_differs_the_numbers_stay_those_of_the_function():
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    plain = ca.Function("f", [x], [3.0 * x], ["x"], ["r"])
    for other in (3.0 * x + p, ca.sqrt(p) * x, x * p * 2):
        printer = Printer(Real.DOUBLE, {}, {"p": [(1.5000001, "a.b")]})
        text = printer.kernel(plain, "f", named=ca.Function("f", [x, p], [other], ["x", "p"], ["r"])).text
        near = other.n_dep() and abs(float(ca.Function("g", [x, p], [other])(1.0, 1.5000001)) - 3.0) < 1e-6
        assert ("3.0 * x[0]" in text) != near, text


def test_a_law_of_every_axis_is_a_function_with_its_words():
    z, wanted = ca.SX.sym("z", 3), ca.SX.sym("wanted", 3)

    def force(d):
        return 2 * d + 5 * d**3

    law = Law(
        "restoring_force",
        "Restoring force [N]: F = 2 d + 5 d^3. Source: a test.",
        ca.Function("l", [z], [force(z)], ["z"], ["f"]),
    )
    printer = Printer(Real.DOUBLE, {}, laws=[law])
    text = printer.kernel(ca.Function("f", [wanted], [ca.sqrt(1 + force(wanted))], ["wanted"], ["r"]), "f").text
    assert "restoring_force(wanted[i])" in text
    assert (
        "F = 2 d + 5 d^3. Source: a test." in printer.laws_text
        and "double restoring_force(double z)" in printer.laws_text
    )


def test_a_law_that_differs_between_axes_stays_in_the_loop():
    z = ca.SX.sym("z", 2)
    forces = ca.vertcat(2 * z[0] + 5 * z[0] ** 3, 3 * z[1] + 5 * z[1] ** 3)
    printer = Printer(Real.DOUBLE, {}, laws=[Law("restoring_force", "", ca.Function("l", [z], [forces], ["z"], ["f"]))])
    assert "restoring_force" not in printer.kernel(ca.Function("f", [z], [1 + forces], ["z"], ["r"]), "f").text


@pytest.mark.parametrize(
    ("law", "value"),
    [
        (lambda x, p: x + p, 0.0),
        (lambda x, p: ca.if_else(p > 0.0, x, 2 * x), 0.0),
        (lambda x, p: x**p, 2.0),
        (lambda x, p: ca.fmin(p * x, 3.0 * ca.sin(x)), 3.0),
        (lambda x, p: p * x, 1.0),
    ],
)
def test_no_decision_is_taken_on_the_value_of_a_number_that_is_given_at_the_start(law, value):
    """The expression keeps the number where its value in the file alone would leave it out."""
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    graph = Graph({"a.b": (-5.0, 5.0)})
    rows = graph.rows(ca.Function("f", [x, p], [law(x, p)], ["x", "p"], ["y"]), {}, {"p": [(value, "a.b")]})
    assert any(node.source is not None for node in reached(rows))


@pytest.mark.parametrize(
    ("factor", "highest"),
    [(3e-20, 3e7), (1e7, 1e-20), (4e19, 1e-7), (1e-7, 1e20)],
    ids=("small numbers", "small operands", "large numbers", "large operands"),
)
def test_numbers_are_gathered_only_where_a_float_can_hold_every_product(factor, highest):
    """(c x)(c y) is of a size that a float holds, and c c or x y is not."""
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    product = ca.Function("f", [x, y], [(factor * x) * (factor * y)], ["x", "y"], ["r"])
    ranges = {name: (np.zeros(1), np.full(1, highest)) for name in ("x", "y")}
    for node in reached(Graph().rows(product, ranges)):
        assert 1e-38 < max(abs(v) for v in node.within) < 3e38


def value_of(node: Node, given: float) -> float:
    """The value of an expression in the first number that the program is given when it starts."""
    if node.constant:
        return node.value
    if node.leaf:
        assert node.array == GIVEN and node.index == 0
        return given
    symbols = [ca.SX.sym("s") for _ in node.operands]
    apply = {
        ca.OP_ADD: lambda a, b: a + b,
        ca.OP_SUB: lambda a, b: a - b,
        ca.OP_MUL: lambda a, b: a * b,
        ca.OP_DIV: lambda a, b: a / b,
        ca.OP_EXP: ca.exp,
        ca.OP_TANH: ca.tanh,
        ca.OP_TWICE: lambda a: 2 * a,
        ca.OP_NEG: lambda a: -a,
        ca.OP_INV: lambda a: 1 / a,
        ca.OP_SQ: lambda a: a * a,
    }
    f = ca.Function("f", symbols, [apply[node.operation](*symbols)])
    return float(f(*(value_of(part, given) for part in node.operands)))


@pytest.mark.parametrize(
    "law",
    [
        lambda p: ca.exp(p) - 1,
        lambda p: ca.exp(p) + 1,
        lambda p: ca.exp(p) + (-1.0),
        lambda p: ca.exp(p) - (-1.0),
        lambda p: 1 - ca.exp(p),
        lambda p: ca.exp(p) - 2,
        lambda p: ca.exp(-2 * p) - 1,
        lambda p: ca.sin(p) * 0 + p - 1,
    ],
)
@pytest.mark.parametrize("given", [0.3, 1.7])
def test_what_follows_from_a_number_given_at_the_start_has_its_value(law, given):
    """exp(y) - 1 is printed in another form, for its digits where y is small."""
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    graph = Graph({"a.b": (0.1, 2.0)})
    (row,) = graph.rows(ca.Function("f", [x, p], [x * law(p)], ["x", "p"], ["y"]), {}, {"p": [(0.5, "a.b")]})
    (number,) = (node for node in reached([row]) if node.source is not None and node in row.operands)
    wanted = float(ca.Function("law", [p], [law(p)])(given))
    assert value_of(number.source, given) == pytest.approx(wanted, rel=1e-12)


def test_the_difference_of_a_small_exponential_from_one_keeps_its_digits():
    """A time constant that is long beside the sample time: 1 - exp(-1e-9) of a float is 0, or 6e-8."""
    x, p = ca.SX.sym("x"), ca.SX.sym("p")
    graph = Graph({"a.b": (1e-10, 1.0)})
    (row,) = graph.rows(ca.Function("f", [x, p], [x * (ca.exp(-p) - 1)], ["x", "p"], ["y"]), {}, {"p": [(1e-9, "a.b")]})
    (number,) = (node for node in reached([row]) if node.source is not None and node in row.operands)
    assert any(node.operation == ca.OP_TANH for node in reached([number.source]))
    assert not any(node.operation == ca.OP_EXP for node in reached([number.source]))
    assert value_of(number.source, 1e-9) == pytest.approx(np.expm1(-1e-9), rel=1e-14)


@pytest.mark.parametrize("law", [lambda x, y, p, q: ca.fmin(p * x, q * y), lambda x, y, p, q: ca.fmax(p * x, 2.0 * y)])
def test_numbers_given_at_the_start_are_not_gathered_because_they_are_equal_in_the_file(law):
    """min(p x, q y) is p min(x, y) for p = q alone."""
    x, y, p, q = (ca.SX.sym(name) for name in "xypq")
    graph = Graph({"a.p": (1.0, 5.0), "a.q": (1.0, 5.0)})
    f = ca.Function("f", [x, y, p, q], [law(x, y, p, q)], list("xypq"), ["r"])
    (row,) = graph.rows(f, {}, {"p": [(2.0, "a.p")], "q": [(2.0, "a.q")]})
    assert row.operation in (ca.OP_FMIN, ca.OP_FMAX)
