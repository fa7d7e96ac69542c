"""Concealed cases from a seed: what is planted, how large, and the folders a diagnosis and the scorer read.

DIR/cases/case_0001/{device.toml, recording.toml, record_*.csv} tells nothing; DIR/answers/case_0001.json is sealed.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from battery import axis_cases, gap_cases, hexapod_cases, laws, region_cases, rough_cases, spike_cases
from battery.plant_axis import Planted
from battery.seal import seal
from battery.size import OWN, Ruler, left_over

SINGLE = (
    "stiffening",
    "hysteresis",
    "log_creep",
    "creep",
    "backlash",
    "coulomb",
    "stribeck",
    "viscous",
    "quadratic_damping",
    "end_stop",
    "resonance",
    "softening",
    "cyclic",
    "bow",
    "drift",
    "temperature_sensitivity",
    "low_pass",
    "delay",
    "quantisation",
    "saturation",
    "dead_zone",
    "lost_beams",
    "degradation",
    "thermal_lag",
    "vibration",
    "step",
    "drive_gain",
    "sensor_gain",
    "stiffness",
    "home_offset",
)
FIXED = ("low_pass", "delay", "stuck")  # drawn at a size a bench would see, not scaled
WEAK = tuple(n for n in SINGLE if n not in (*FIXED, *OWN, "quantisation", "end_stop"))
# A mixture takes one from each of two or three
GROUPS = (
    ("creep", "log_creep", "thermal_lag", "drift"),
    ("stiffening", "softening", "bow"),
    ("hysteresis", "coulomb", "backlash", "quadratic_damping", "viscous"),
    ("lost_beams", "step", "vibration"),
    ("cyclic", "delay"),
    ("resonance",),
)
LOOP = ("coulomb", "stribeck", "viscous", "quadratic_damping", "cyclic", "lost_beams", "step", "backlash")
# By class, in the order of CLASSES
COUNTS = {
    "ci": (1, 2, 1, 1, 1, 0, 1, 1, 1, 1, 1, 0, 0, 0, 0),
    "small": (10, 30, 8, 8, 7, 4, 2, 11, 10, 10, 12, 13, 12, 8, 9),
    "full": (110, 90, 40, 48, 42, 16, 10, 33, 200, 72, 204, 78, 96, 104, 48),
}
ROUGH = ("messy", "memory", "null", "forms")
FURTHER = {"regional": region_cases, "gaps": gap_cases, "spikes": spike_cases}
TEXTBOOK = ("clean", "single", "weak", "multiple", "outside", "confusable", "hexapod_clean", "hexapod_single")
CLASSES = (*TEXTBOOK, *ROUGH, *FURTHER)
Rng = np.random.Generator


@dataclass(frozen=True)
class Order:
    """One case to be made: its number in the folder, class, what to plant (where the plan says), and its seed."""

    number: int
    kind: str
    wanted: tuple[str, ...]
    seed: tuple[int, int]
    seconds: float


def plan(seed: int, size: str, classes: Sequence[str] = CLASSES) -> list[Order]:
    """All cases of these `classes` of a battery, shuffled so that a number tells nothing; a case is the same beside others."""
    rng = np.random.default_rng([seed, 0])
    rows: list[tuple[str, tuple[str, ...]]] = []
    for kind, count in zip(CLASSES, COUNTS[size], strict=True):
        pool = {
            "single": SINGLE,
            "weak": WEAK,
            "outside": laws.STRANGE,
            "hexapod_single": tuple(hexapod_cases.FAULTS),
            "confusable": ("slow", "gain", "quasi-static", "commuting"),
        }.get(kind)
        if kind in ROUGH:
            names = rough_cases.plan(kind, rng, count)
        elif kind in FURTHER:
            names = FURTHER[kind].plan(rng, count)
        elif kind == "multiple":
            names = [_mixture(rng, 2 + k % 2) for k in range(count)]
        elif pool:
            cycle = itertools.cycle(rng.permutation(pool).tolist())
            names = [(next(cycle),) for _ in range(count)]
        else:
            names = [()] * count
        rows += [(kind, name) for name in names]
    order = [k for k in rng.permutation(len(rows)).tolist() if rows[k][0] in classes]
    return [Order(i + 1, *rows[k], (seed, k + 1), 4.0 if size == "ci" else 6.0) for i, k in enumerate(order)]


def _mixture(rng: Rng, n: int) -> tuple[str, ...]:
    groups = rng.choice(len(GROUPS), n, replace=False)
    return tuple(str(rng.choice(GROUPS[g])) for g in groups)


def _truth(planted: Planted, size: float, location: str) -> dict[str, Any]:
    return {
        "name": planted.name,
        "location": location,
        "size": size,
        "amplitude": planted.amplitude,
        "shape": planted.shape,
    }


def _clean(order: Order, rng: Rng) -> tuple[Callable[[Path], None], dict[str, Any]]:
    bench = axis_cases.draw_bench(rng, order.seconds, loop=rng.uniform() < 0.15)
    spikes = bool(rng.uniform() < 0.33)
    if spikes:
        bench = axis_cases.with_spikes(rng, bench)
    return (lambda d: axis_cases.write_bench(d, bench, [])), axis_cases.describe(bench) | {
        "spikes": spikes,
        "planted": [],
    }


def _ruler(bench: axis_cases.Bench) -> Ruler:
    t = bench.fit
    return Ruler(bench.axis, bench.scene, t.drive, t.start, t.ambient, t.noise, bench.linear)


def _with_laws(order: Order, rng: Rng) -> tuple[Callable[[Path], None], dict[str, Any]]:
    """Single, weak, multiple and outside: draw until every law has its size."""
    low, high = {"weak": (0.3, 1.0), "outside": (4.0, 60.0)}.get(order.kind, (1.0, 60.0))
    for _ in range(20):
        loop = order.kind in {"single", "weak"} and order.wanted[0] in LOOP and rng.uniform() < 0.25
        needs_room = "temperature_sensitivity" in order.wanted
        bench = axis_cases.draw_bench(rng, order.seconds, loop, True if needs_room else None)
        ruler = _ruler(bench)
        try:
            found = [_place(n, rng, bench, ruler, low, high, order.kind) for n in order.wanted]
        except ValueError:
            continue
        planted = [p for p, _ in found]
        truth = [_truth(p, s, f"{laws.PLACE.get(p.name, 'stage')}:axis") for p, s in found]
        return (lambda d, b=bench, p=planted: axis_cases.write_bench(d, b, p)), axis_cases.describe(bench) | {
            "planted": truth
        }
    raise RuntimeError(
        f"case {order.number} ({order.wanted}): no draw gave the wanted size; widen the law's shape values"
    )


def _place(name: str, rng: Rng, bench: axis_cases.Bench, ruler: Ruler, low: float, high: float, kind: str) -> Any:
    """The law `name` at a size drawn from (low, high) and that size; nominal numbers at 6 to 10 stated deviations."""
    law = laws.draw(name, rng, bench.scene)
    if name in OWN:
        sd = {"stiffness": 0.03, "home_offset": 20 * bench.scene.noise}.get(name, 0.02)
        times = rng.uniform(6, 10) if name != "home_offset" else rng.uniform(0.5, 3)
        law = replace(law, amplitude=float(rng.choice([-1, 1]) * times * sd))
        return law, ruler.size(law)
    if name in FIXED:
        law = replace(law, amplitude=law.amplitude * float(rng.uniform(0.7, 1.6)))
        size = ruler.size(law)
        if size < low:
            raise ValueError(f"{name}: size {size:.2g} is below {low:g}")
        return law, size
    top = 0.8 if kind == "weak" else high / 2
    bottom = 1.25 * low
    return ruler.scaled(law, float(np.exp(rng.uniform(np.log(bottom), np.log(top)))), low, high)


def _confusable(order: Order, rng: Rng) -> tuple[Callable[[Path], None], dict[str, Any]]:
    """Records on which the truth and its rivals give the same output after a refit, to below 0.3 noise."""
    for _ in range(200):
        bench, pair = _inseparable(order.wanted[0], rng, order.seconds)
        ruler = _ruler(bench)
        order_of = list(pair) if order.wanted[0] == "commuting" else rng.permutation(pair).tolist()
        first, second = (laws.draw(n, rng, bench.scene) for n in order_of)
        try:
            law, size = _place(first.name, rng, bench, ruler, 2.0, 20.0, "single")
        except ValueError:
            continue
        rivals = [second]
        if second.name == "creep":  # a chain of relaxations is the ladder's own rival
            tau = law.shape["tau"]
            rivals = [replace(second, shape={"tau": tau * x, "second": 1.0}) for x in (0.03, 0.1, 0.3, 1.0)]
        columns = np.column_stack([ruler.columns, *(ruler.change([r]) for r in rivals)])
        apart = left_over(ruler.change([law]), columns) / bench.scene.noise
        if apart < 0.3:
            truth = [_truth(law, size, f"{laws.PLACE.get(law.name, 'stage')}:axis")]
            return (lambda d, b=bench, p=law: axis_cases.write_bench(d, b, [p])), axis_cases.describe(bench) | {
                "planted": truth,
                "rivals": [n for n in pair if n != law.name],
                "apart": apart,
            }
    raise RuntimeError(f"case {order.number} ({order.wanted}): no inseparable pair drawn")


def _inseparable(which: str, rng: Rng, seconds: float) -> tuple[axis_cases.Bench, tuple[str, str]]:
    """A bench on which a pair of causes looks the same."""
    bench = axis_cases.draw_bench(rng, seconds, ambient=False)
    pair = {
        "slow": ("drift", "degradation"),
        "gain": ("sensor_gain", "drive_gain"),
        "quasi-static": ("bow", "stiffening"),
        "commuting": ("thermal_lag", "creep"),
    }[which]
    level = float(np.abs(bench.fit.drive).max())
    if which == "slow":  # one level held: a falling gain is a drift
        bench = _redriven(bench, lambda n, role: level * np.minimum(np.arange(n) / (200 if role == "fit" else 400), 1))
    if which == "quasi-static":  # slow and one-sided: every smooth curve over a short stretch is a parabola
        bench = _redriven(
            bench,
            lambda n, role: (
                level
                * np.minimum(np.arange(n) / 300, 1)
                * (0.9 + 0.1 * np.sin(2 * np.pi * np.arange(n) / (1000 if role == "fit" else 1700)))
            ),
        )
    return bench, pair


def _redriven(bench: axis_cases.Bench, drive: Callable[[int, str], Any]) -> axis_cases.Bench:
    takes = tuple(t if t.role == "rest" else replace(t, drive=drive(len(t.drive), t.role)) for t in bench.takes)
    return replace(bench, takes=takes)


def _hexapod(order: Order, rng: Rng) -> tuple[Callable[[Path], None], dict[str, Any]]:
    for _ in range(50):
        bench = hexapod_cases.draw_bench(rng)
        fault = hexapod_cases.FAULTS[order.wanted[0]](rng) if order.wanted else None
        size = hexapod_cases.size(bench, fault) if fault else 0.0
        if fault is None or size >= 1:
            break
    truth = [_truth(Planted(fault.name, fault.amplitude), size, fault.location)] if fault else []
    return (lambda d: hexapod_cases.write_bench(d, bench, fault)), hexapod_cases.describe(bench) | {"planted": truth}


def _rough(order: Order, rng: Rng) -> tuple[Callable[[Path], None], dict[str, Any]]:
    return rough_cases.make(order.kind, order.wanted, order.seconds, rng)


def _further(order: Order, rng: Rng) -> tuple[Callable[[Path], None], dict[str, Any]]:
    return FURTHER[order.kind].make(order.wanted, rng)


MAKERS = {"clean": _clean, "confusable": _confusable, "hexapod_clean": _hexapod, "hexapod_single": _hexapod}
MAKERS |= dict.fromkeys(ROUGH, _rough) | dict.fromkeys(FURTHER, _further)


def make_case(order: Order, folder: Path) -> str:
    """Write one case and its sealed answer; its name."""
    name = f"case_{order.number:04d}"
    write, answer = MAKERS.get(order.kind, _with_laws)(order, np.random.default_rng(list(order.seed)))
    write(folder / "cases" / name)
    seal(folder / "answers" / f"{name}.json", {"case": name, "class": order.kind} | answer)
    return name


def make(
    folder: Path,
    seed: int,
    size: str,
    jobs: int = 2,
    progress: Callable[[int, int], None] | None = None,
    classes: Sequence[str] = CLASSES,
) -> None:
    """All cases of these `classes` of a battery into an empty or new `folder`."""
    if (folder / "answers").exists():
        raise FileExistsError(f"{folder} already holds a battery; give another folder or remove it")
    orders = plan(seed, size, classes)
    with ProcessPoolExecutor(jobs) as pool:
        waiting = [pool.submit(make_case, order, folder) for order in orders]
        for done, future in enumerate(as_completed(waiting), 1):
            future.result()
            if progress:
                progress(done, len(orders))
    (folder / "battery.json").write_text(
        json.dumps({"seed": seed, "size": size, "classes": list(classes), "cases": len(orders)}) + "\n"
    )
