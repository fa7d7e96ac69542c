"""C of CasADi functions as one loop over samples, for a compiler that is to be quick.

CasADi's generator writes plain C. Here a long function is cut into parts, what nothing needs is left out, and the products of full
matrices are taken four rows at a time (`matrix_kernels.c`), which a processor with AVX2 does in one instruction.
"""

from __future__ import annotations

import re
from importlib.resources import files

import casadi as ca

# Characters of generated C above which it is compiled in parts: the time of one function grows faster than its length. Plays before
# creep, gcc 12: 0.6 instead of 1.0 s of 118,000 and 1.5 instead of 3.6 s of 270,000, and about the same time of a sample.
LARGE = 100_000
PART = 250  # statements of a part
FUNCTION = re.compile(
    r"^static int (?P<name>casadi_f\d+)\((?P<arguments>[^)]*)\) \{\n(?P<body>.*?)  return 0;\n\}\n", re.M | re.S
)
IN_WORK_VECTOR = re.compile(r"  (w\[\d+\]=|if \(res\[\d+\]!=0\) )")
PLACE = re.compile(r"w\[(\d+)\]")

INTERFACE = re.compile(r"^CASADI_SYMBOL_EXPORT int \w+\(.*\{\n  return (?P<main>casadi_f\d+)\(", re.M)
KEEPS_NO_MEMORY = re.compile(r"_checkout\(void\) \{\n  return 0;\n\}")
CONFIGURATION = re.compile(
    r"^CASADI_SYMBOL_EXPORT \w+ \w*casadi_(version|int_size|real_size)\(.*\{(.*\}|[^}]*\n\})\n", re.M
)
# what CasADi calls for one or two numbers
HELPER = re.compile(r"^(?=casadi_real casadi_\w+\(casadi_real \w+(, casadi_real \w+)?\) ?\{)", re.M)
# <math.h> without what a header takes: what CasADi calls, and the two numbers
UNARY = "acos acosh asin asinh atan atanh cbrt ceil cos cosh erf exp expm1 fabs floor log log10 log1p sin sinh sqrt tan tanh"
BINARY = "atan2 copysign fmax fmin fmod hypot pow remainder"
DECLARED = (
    "".join(f"double {name}(double);\n" for name in UNARY.split())
    + "".join(f"double {name}(double, double);\n" for name in BINARY.split())
    + '#define INFINITY __builtin_inf()\n#define NAN __builtin_nan("")\n'
)

# A recursion as one call, sample after sample on the caller's memory: CasADi copies what goes in and out of every sample, which takes
# as long as the equations of an axis. What a fast lag remembers of its beginning decays below the least normal number, which slows a
# processor down: it is flushed to zero while the loop runs (slopes of a lag of 10 ms along 20,000 samples: 0.6 instead of 1.0 s).
# `by`: numbers from one sample of an argument to the next, 0 for one that is constant.
LOOP = """
CASADI_SYMBOL_EXPORT int run(casadi_int n, const casadi_real** given, const casadi_int* by, casadi_int n_given,
                             const casadi_real* state, casadi_real* states, casadi_int n_s, casadi_real* results, casadi_int n_r,
                             const casadi_real** arg, casadi_real** res, casadi_int* iw, casadi_real* w) {{
  casadi_int k, i, failed = 0;
#ifdef __SSE2__
  const unsigned mode = __builtin_ia32_stmxcsr();
  __builtin_ia32_ldmxcsr(mode | 0x8040);
#endif
  for (k = 0; k < n && !failed; ++k) {{
    arg[0] = state;
    for (i = 0; i < n_given; ++i) arg[i + 1] = given[i] + k*by[i];
    res[0] = states + k*n_s;
    res[1] = results + k*n_r;
    failed = {main}(arg, res, iw, w, 0) != 0;
    state = states + k*n_s;
  }}
#ifdef __SSE2__
  __builtin_ia32_ldmxcsr(mode);
#endif
  return (int) failed;
}}
"""

# what `matrix_kernels.c` takes the place of
REPLACED = re.compile(r"^void casadi_(?:clear|copy|mtimes_dense_sparse)\(.*?^\}\n", re.M | re.S)
BEFORE_HELPERS = "/* Symbol visibility in DLLs */\n"
KERNELS = files("ctrlgen.numerics").joinpath("matrix_kernels.c").read_text()


def c_code(function: ca.Function) -> str:
    """C of the recursion `function` in a loop over samples, in parts where it is long. Raises ValueError for a function that keeps memory
    from one call to the next."""
    code = casadi_c(function)
    interface = INTERFACE.search(code)
    if interface is None or not KEEPS_NO_MEMORY.search(code):
        raise ValueError(f"{function.name()} keeps memory from one call to the next")
    code = CONFIGURATION.sub("", code[: interface.start()]).replace("#include <math.h>\n", DECLARED)
    code, replaced = REPLACED.subn("", code)
    if replaced:
        code = code.replace(BEFORE_HELPERS, f"{KERNELS}\n{BEFORE_HELPERS}")
    return HELPER.sub("static inline __attribute__((always_inline)) ", code) + LOOP.format(main=interface["main"])


def casadi_c(function: ca.Function) -> str:
    """C of any `function` with CasADi's interface, in parts where it is long."""
    code = _generated(function, avoid_stack=False)
    return code if len(code) < LARGE else _in_parts(_generated(function, avoid_stack=True))


def _generated(function: ca.Function, avoid_stack: bool) -> str:
    generator = ca.CodeGenerator("step.c", {"avoid_stack": avoid_stack})
    generator.add(function)
    return generator.dump()


def _in_parts(code: str) -> str:
    """The generated C with long functions that only compute in the work vector cut into functions of `PART` statements, as a compiler's
    time grows faster than the length of a function. What no other part reads is a local variable, as every access to the work vector
    is a memory access to the compiler too: in all half of the time."""

    def parts(match: re.Match[str]) -> str:
        name, body = match["name"], match["body"].splitlines(keepends=True)
        if len(body) <= PART or not all(IN_WORK_VECTOR.match(line) for line in body):
            return match[0]
        pieces = _with_locals([body[k : k + PART] for k in range(0, len(body), PART)])
        head = "(const casadi_real** arg, casadi_real** res, casadi_real* w)"
        defined = "".join(
            f"__attribute__((noinline)) static void {name}_{k}{head} {{\n{piece}}}\n\n"
            for k, piece in enumerate(pieces)
        )
        calls = "".join(f"  {name}_{k}(arg, res, w);\n" for k in range(len(pieces)))
        return f"{defined}static int {name}({match['arguments']}) {{\n{calls}  return 0;\n}}\n"

    return FUNCTION.sub(parts, code)


def _with_locals(parts: list[list[str]]) -> list[str]:
    """The parts, in each a local variable for every value, which ends in the work vector where a later part reads it."""
    read: set[str] = set()  # places that the parts after this one read before they write them
    pieces = []
    for part in reversed(parts):
        now: dict[str, str] = {}  # place -> the local variable that holds it
        before: set[str] = set()
        lines = []

        def local(match: re.Match[str], now: dict[str, str] = now, before: set[str] = before) -> str:
            if match[1] not in now:
                before.add(match[1])
            return now.get(match[1], match[0])

        for statement in part:
            place = PLACE.match(statement, 2)
            if place is None:
                lines.append(PLACE.sub(local, statement))
                continue
            value = PLACE.sub(local, statement[place.end() :])
            now[place[1]] = f"a{len(lines)}"
            lines.append(f"  const casadi_real a{len(lines)}{value}")
        lines += [f"  w[{place}]={name};\n" for place, name in now.items() if place in read]
        read = (read - now.keys()) | before
        pieces.append("".join(lines))
    return pieces[::-1]
