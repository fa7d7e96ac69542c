"""The C of the limiter, `codegen/limiter`, with the numbers, tables and kernels of one device: what its macros stand for, its text."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ctrlgen.controller.clocked import BACKWARD
from ctrlgen.controller.estimate import DOUBLED, EXACT
from ctrlgen.controller.feedforward import REACH_FRACTION, SECANT_FRACTION, SECANT_STEPS
from ctrlgen.controller.nearest_displacement import SWEEPS
from ctrlgen.controller.ringing import GONE, TOLD
from ctrlgen.firmware.c.preprocessor import Macro, resolved
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import codegen_folder
from ctrlgen.firmware.online.limit_tables import within_test
from ctrlgen.model.discretisation import SETTLING_SWEEPS

CONFIGURATION = "limiter_config.h"  # what the macros are defined in, where the files are compiled as they are
WIDE = 110  # characters of a statement that a macro stands for
# Arrays of numbers of the context of online.c.j2: Z_LOW_TABLE is what stands in braces for "z_low".
TABLES = "z_low z_high z_slack s_low s_high s_slack u_low u_high u_slack fall rise rest"
# Parameters of the macros that call kernels, and what the kernels take for their arguments.
CALLS = {
    "balance": ("state x z drive result", {"x": "x", "z": "z", "drive": "drive"}),
    "shares": ("state wanted result", {"x": "state->x", "z": "state->z", "wanted": "wanted"}),
    "few": ("wanted result", {"wanted": "wanted"}),
    "of_few": ("few result", {"few": "few"}),
    "displacement": ("state target result", {"x": "state->x", "z": "state->z", "target": "target"}),
    "state": ("state wanted result", {"x": "state->x", "z": "state->z", "wanted": "wanted"}),
    "drive": (
        "state wanted limited result",
        {"x": "state->x", "z": "state->z", "wanted": "wanted", "state": "limited"},
    ),
    "advance": ("state z drive result", {"x": "state->x", "z": "z", "drive": "drive"}),
    "motion": ("target result", {"target": "target"}),
    "about": ("pose pivot result", {"pose": "pose", "pivot": "pivot"}),
}


def limiter_text(prefix: str, real: Real, macros: Mapping[str, Macro]) -> str:
    """The limiter as it stands in the C of one device, its public names with the `prefix`, its numbers `real`."""

    def text(name: str) -> str:
        source = (codegen_folder() / "limiter" / name).read_text(encoding="utf-8")
        # Without what the file says of itself.
        source = source.partition("*/\n")[2].lstrip("\n").replace(f'#include "{CONFIGURATION}"\n', "")
        # Before macros are expanded: these hold names that the device gives.
        for word, written in ((r"real\b", real.value), ("limiter_", f"{prefix}_"), ("LIMITER_", f"{prefix.upper()}_")):
            source = re.sub(rf"\b{word}", written, source)
        return source

    return re.sub(r"\n{3,}", "\n\n", resolved(text("limiter.c"), macros, text).strip("\n")) + "\n"


def limiter_macros(context: Mapping[str, Any]) -> dict[str, Macro]:
    """What stands for each macro of the limiter; `context` of online.c.j2."""
    real: Real = context["real"]
    counts = {"AXIS": context["n"], "STATE": context["n_s"], "DRIVE": context["nu"]}
    macros = {f"EACH_{name}": Macro("\n".join(f"F({k})" for k in range(n)), ("F",)) for name, n in counts.items()}
    macros |= {"REAL": Macro("x ## f" if real is Real.FLOAT else "x", ("x",))}
    macros |= {name: Macro(str(int(value))) for name, value in _features(context).items()}
    macros |= {
        name: Macro(text)
        for name, text in (
            _texts(context) | _start_texts(context) | _estimate_texts(context) | _ringing_texts(context)
        ).items()
    }
    return macros | {name: Macro(body, tuple(given.split())) for name, (given, body) in _calls(context).items()}


def _features(context: Mapping[str, Any]) -> dict[str, int]:
    """Sizes, and 1 for what the device has, else 0."""
    modes, limited, moves = (
        {mode["name"]: mode for mode in context["modes"]},
        limited_modes(context),
        context["redundancy"],
    )
    has = {
        "STATE_LIMITED": context["state_limited"],
        "BOUNDED": context["bound"] is not None,
        "DIRECT": context["direct"],
        "BOUND_FIRST": context["target_bound"] is not None,
        "RATED": context["rated"],
        "PASSING": context["passing"],
        "REDUNDANT": moves is not None,
        "COUPLED": context["nearest_slopes"] is not None,
        "MOVING": "step" in modes,
        "MOTION": bool(context["motion"]),
        "NY": 0 if context["ringing"] is None else len(context["ringing"].weights),
        "PIVOTED": context["pivot"] is not None,
        "U_BOUNDS_ONCE": bounds_once(context),
        "REST_GIVEN": bool(context["rest_given"]),
        "CHANGING": context["changing"] is not None,
        "DOUBLE": context["real"] is Real.DOUBLE,
        "FILLED": "unused" in context["words"],
        "ESTIMATED": context["estimated"] is not None,
        "REMEMBERING": context["estimated"] is not None and "z" in modes["step"]["advance"].arguments,
        "RINGING": context["ringing"] is not None,
        "OBSERVED": context["observed"],
        "VARIED": context["times"] is not None,
        # Whether the line search calls one kernel to settle and another to step
        "STATE_BY_MODE": len({mode["state"].name for mode in limited if "state" in mode}) > 1,
        "DRIVE_BY_MODE": len({mode["drive"].name for mode in limited}) > 1,
        "OWN_DRIVES": bool(limited) and context["own_drives"],
        "ADVANCE_BY_MODE": len({mode["advance"].name for mode in limited if "advance" in mode}) > 1,
    }
    for name in ("settle", "step"):
        for flag, key in (("DRIVE_LIMITED", "drive_can_be_limited"), ("EXAMINED_FIRST", "examined_first")):
            has[f"{name}_{flag}".upper()] = name in modes and modes[name][key]
    return has | {
        "N": context["n"],
        "NU": context["nu"],
        "NS": context["n_s"],
        "NX": len(context["x_names"]),
        "M": context["m"],
        "SHARES": context["shares_count"],
        "FEW": context["few_count"],
        "COMPOSITE_ROUNDS": context["composite_rounds"],
        "SWEEPS": SWEEPS,
        "SECANT_STEPS": SECANT_STEPS,
        "GROUPS": 0 if moves is None else len(moves.groups),
        "GIVEN": len(context["given"]),
    }


def limited_modes(context: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The modes in which a drive beyond its limits can be needed."""
    return [mode for mode in context["modes"] if mode["drive_can_be_limited"]]


def bounds_once(context: Mapping[str, Any]) -> bool:
    """Whether one function alone reads the limits of the drives."""
    another = context["motion"] or context["redundancy"] or limited_modes(context)
    return len(context["modes"]) == 1 and not another


def _texts(context: Mapping[str, Any]) -> dict[str, str]:
    """The texts that limiter.c takes, by name: tables, numbers and names."""
    literal = context["real"].literal

    def table(values: Iterable[float]) -> str:
        return _braces(literal(v) for v in values)

    texts = {name.upper(): f"{context['prefix']}_{name}_{context['build']}" for name in ("init", "init_with")}
    texts |= {f"{name}_table".upper(): table(context[name]) for name in TABLES.split() if name in context}
    texts |= {
        "HOME_TABLE": table(np.zeros(context["n"])),
        "COMPOSITE_SLACK": literal(1.0 + context["relative_slack"]),
        "COMPOSITE_SLACK_SQUARED": literal((1.0 + context["relative_slack"]) ** 2),
        "SECANT_FRACTION": literal(SECANT_FRACTION),
        "REACH_FRACTION": literal(REACH_FRACTION),
        "UNLIMITED": literal(context["unlimited"]),
    }
    # Of limits that follow from the constants of the start there is no table: they are members of the state.
    given = {name: member for name, member in context["arrays"].items() if member != name}
    for name in given:
        texts.pop(f"{name}_TABLE", None)
    texts |= {name: member for name, member in given.items() if name.startswith("U_")}
    texts |= {"STATE_LOW": given.get("S_LOW", "LOW"), "STATE_HIGH": given.get("S_HIGH", "HIGH")}
    if (moves := context["redundancy"]) is not None:
        starts = np.cumsum([0, *(len(those) for those in moves.groups)])
        texts |= {
            "NULL_MOTION_TABLE": table(moves.direction),
            "NULL_SHARE_TABLE": table([1.0 / w if w else 0.0 for w in moves.direction]),
            "GROUP_MEMBERS": _braces(str(i) for those in moves.groups for i in those),
            "GROUP_STARTS": _braces(map(str, starts)),
        }
    if context["times"] is not None:
        shortest, longest = context["times"]
        within = within_test("h", shortest, longest, context["real"])
        texts |= {"TIME_WITHIN": within, "SAMPLE_TIME": literal(context["sample_time"]), "UNCOUNTED": "2U"}
    if context["nearest_slopes"] is not None:
        texts["NEAREST_SWEEP"] = _nearest_sweep(context)
    for mode in limited_modes(context)[:1]:
        texts |= {f"LIMITED_{part}": f"{mode['name']}_{part}".upper() for part in ("STATE", "DRIVE", "ADVANCE")}
        texts["LIMITED_FROM"] = "out->displacement" if mode["name"] == "settle" else "state->z"
    return texts


def _estimate_texts(context: Mapping[str, Any]) -> dict[str, str]:
    """What the macros of estimate.c and estimate_count.c stand for."""
    bounds, n_s, literal = context["estimated"], context["n_s"], context["real"].literal
    if bounds is None:
        return {}
    known = np.minimum(bounds.known, context["unlimited"])
    tables = {
        "KNOWN": known,
        "START": bounds.start,
        "REACH_LOW": bounds.low[:n_s],
        "REACH_HIGH": bounds.high[:n_s],
        "KNOWN_STATE": known[:n_s],
        "SIDE": bounds.side[:n_s],
    }
    counts = {
        "UNKNOWN_TICKS": bounds.unknown,
        "HALVING_TICKS": bounds.halving,
        "EXACT_TICKS": EXACT,
        "BACKWARD": BACKWARD,
        "SETTLING_SWEEPS": SETTLING_SWEEPS,
        "DOUBLED": DOUBLED,
    }
    loops = ("EXACT_TICKS", "SETTLING_SWEEPS", "DOUBLED")  # counted by int
    texts = {f"{name}_TABLE": _braces(literal(v) for v in values) for name, values in tables.items()}
    texts |= {name: str(count) if name in loops else f"{count}U" for name, count in counts.items()}
    return texts | ({"GROWTH": literal(bounds.in_known(n_s))} if n_s else {})


def _ringing_texts(context: Mapping[str, Any]) -> dict[str, str]:
    """What the macros of ringing.c and ringing_count.c stand for."""
    bounds, real = context["ringing"], context["real"]
    if bounds is None:
        return {}
    nx, n = len(context["x_names"]), context["n"]
    reach = np.minimum(bounds.reach[: nx + n], context["unlimited"])
    tables = {
        "X_WEIGHT": bounds.weights[:nx],
        "Z_WEIGHT": bounds.weights[nx : nx + n],
        "U_WEIGHT": bounds.drive,
        "REACH": reach,
        "HELD": bounds.held,
        "HOME_AHEAD": np.append(bounds.weights[:nx] * context["rest"], np.zeros(len(bounds.weights) - nx)),
    }
    # powers of it are taken: rounded up, so that what is left is not taken for less
    decay = 1.0 if bounds.decay == 1.0 else bounds.decay * (1 + real.epsilon)
    numbers = {"DECAY": decay, "LEAST_BREAK": bounds.least, "UNKNOWN_RINGING": bounds.unknown, "TOLD": TOLD}
    numbers["GONE"] = GONE
    texts = {f"{name}_TABLE": _braces(real.literal(v) for v in values) for name, values in tables.items()}
    texts |= {name: real.literal(value) for name, value in numbers.items()}
    return texts | {"BACKWARD": f"{BACKWARD}U", "SETTLING_SWEEPS": str(SETTLING_SWEEPS)}


def _start_texts(context: Mapping[str, Any]) -> dict[str, str]:
    """What the macros of start_constants.c stand for."""
    given, changing = context["given"], context["changing"]
    if not given:
        return {}
    of_state = {c["name"]: f"state->constants.{c['name']}" for c in given}
    within = (within_test(f"constants->{c['name']}", c["low"], c["high"], context["real"]) for c in given)
    texts = {name.upper(): f"0x{context[name]:08X}U" for name in ("crc_polynomial", "magic", "layout")}
    texts |= {
        "GIVEN_VALUES": _braces(of_state.values()),
        "DERIVED_VALUES": str(len(context["assigned"])),
        "SET_DERIVED": _assignments(context["assigned"]),
        "CONSTANTS_WITHIN": " && ".join(within),
        "DEFAULTS": _braces(c["default"] for c in given),
        "SET_REST": "\n".join(f"state->x[{k}] = {member};" for k, member in enumerate(context["rest_given"])),
        "READ_CONSTANTS": "\n".join(
            f"read.{name} = number_at(bytes, {12 + 4 * k}U);" for k, name in enumerate(of_state)
        ),
    }
    if changing is not None:
        constant = changing["constant"]
        texts |= {
            "INPUT_NAME": constant.name,
            "SET_INPUT": f"{context['prefix']}_set_{constant.name}",
            "INPUT_WITHIN": within_test("input", constant.low, constant.high, context["real"]),
            "CHANGED_VALUES": _braces((of_state | {constant.name: "input"}).values()),
            "CHANGED_DERIVED": str(len(changing["assigned"])),
            "SET_CHANGED": _assignments(changing["assigned"]),
        }
    return texts


def _nearest_sweep(context: Mapping[str, Any]) -> str:
    """A sweep of `ctrlgen.controller.nearest_displacement` as statements, axis by axis."""
    literal, lines = context["real"].literal, list[str]()
    ranges = zip(context["nearest_slopes"], context["z_low"], context["z_high"], strict=True)
    for i, (row, low, high) in enumerate(ranges):
        others = "".join(
            f" {'-' if p < 0 else '+'} ({literal(abs(p))} * off[{j}])" for j, p in enumerate(row) if j != i and p
        )
        others = others.removeprefix(" + ") if others.startswith(" +") else others.replace(" - ", "-", 1)
        wanted = f"beyond[{i}] - ({others})" if others else f"beyond[{i}]"
        statement = f"value[{i}] = clipped({wanted}, {literal(low)}, {literal(high)});"
        lines += textwrap.wrap(
            statement, WIDE, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False
        )
        lines += [f"off[{i}] = value[{i}] - beyond[{i}];"]
    return "\n".join(lines)


def _braces(texts: Iterable[str]) -> str:
    return f"{{ {', '.join(texts)} }}"


def _assignments(assigned: Sequence[tuple[str, int]]) -> str:
    return "\n".join(f"state->derived.{name} = value[{k}];" for name, k in assigned)


def _calls(context: Mapping[str, Any]) -> dict[str, tuple[str, str]]:
    """Parameters and body of the macros that call kernels, each with the arguments that the kernel reads."""
    kernels = {"BALANCE": ("balance", context["balance"]), "REACHED": ("balance", context["reached"])}
    if context["pivot"]:
        kernels["OF_PIVOT"] = "about", context["pivot"]["kernel"]
    if context["few"]:
        kernels |= {"FEW_COORDINATES": ("few", context["few"]), "SHARES_OF_FEW": ("of_few", context["shares"])}
    elif context["shares"]:
        kernels["COMPOSITE_SHARES"] = "shares", context["shares"]
    for mode in context["modes"]:
        kernels |= {f"{mode['name']}_{part}".upper(): (part, mode[part]) for part in CALLS if part in mode}
    kernels |= {f"MOTION_{part.upper()}": ("motion", kernel) for part, kernel in context["motion"].items()}
    calls = {
        name: (CALLS[part][0], kernel.call("result", h="&state->h", **CALLS[part][1]))
        for name, (part, kernel) in kernels.items()
    }
    if context["few"]:
        calls["COMPOSITE_SHARES"] = "state wanted result", "used_shares(wanted, result)"
    if context["bound"]:
        calls["COMPOSITE_BOUND"] = "wanted", context["bound"].value(wanted="wanted")
    if context["target_bound"]:
        calls["TARGET_BOUND"] = "target", context["target_bound"].value(target="target")
    for name, tests in (("state_inside", context["s_tests"]), ("drive_inside", context["u_tests"])):
        follows = any("derived" in test for test in tests)
        calls[name.upper()] = "state value", f"{name}({'&state->derived, ' if follows else ''}value)"
    return calls
