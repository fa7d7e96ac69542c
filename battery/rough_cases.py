"""The classes where the world is rough: messy cases, memory in all its forms, and clean records with rough noise."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from battery import axis_cases, hexapod_cases, laws, memory, messy, pose_cases, servo_cases
from battery.axis_cases import Bench, Rng
from battery.plant_hexapod import AXES, Hexapod, changed
from battery.size import Ruler
from plants.numbers import read

Sizes = tuple[float, float]
Made = tuple[Callable[[Path], None], dict[str, Any]]
DEVICES = ("axis", "mems", "axis", "axis", "meso")  # of messy cases, in turn
NULLS = ("spikes", "coloured", "understated", "overstated", "linear", "linear_hexapod")
STATED = {"understated": 0.7, "overstated": 1.5}  # noise over the true one
MEMORY = (10.0, 300.0)  # size of a memory alone, as battery.messy.DOMINANT
ZEROS = {"name": "zero_per_record", "location": "sensor:all"}  # what the zero point of each record is, as a law
ZERO = 0.05  # largest zero point of a record over the rms of the largest cause
LEAST_SHARE = 0.1  # of the mismatch on the held-out record, of a dominant cause
LEAST_TOGETHER = 0.8  # of all dominant causes
TRIES = 60
SERIES_PERIOD = 2e-3  # s, of the hexapod's series


def plan(kind: str, rng: Rng, count: int) -> list[tuple[str, ...]]:
    """What each of `count` cases of a class is to hold."""
    if kind == "null":
        cycle = itertools.cycle(rng.permutation(NULLS).tolist())
        return [(next(cycle),) for _ in range(count)]
    if kind == "messy":
        return [(DEVICES[k % 5], *_dominant(rng, DEVICES[k % 5], 1 + k % 2)) for k in range(count)]
    if kind == "forms":
        rooms = [*itertools.product(("servo", "meso", "axis", "mems"), ("single",), memory.FORMS)]
        rooms += [("axis", "single", "cogging")] * 2
        cycle = itertools.cycle(rng.permutation(rooms).tolist())
        return [tuple(map(str, next(cycle))) for _ in range(count)]
    forms = rng.permutation(list(memory.FAMILY)).tolist()
    rooms = rng.permutation(list(itertools.product(("series", "poses"), ("single", "messy"), (0, 1)))).tolist()
    pairs = [(*rooms[k % 8], forms[(k + k // 72) % 9]) for k in range(count)]  # 8 and 9 have no common factor: all meet
    device = {("series", 0): "axis", ("series", 1): "servo", ("poses", 0): "mems", ("poses", 1): "meso"}
    return [(device[room, int(which)], how, form) for room, how, which, form in pairs]


def _dominant(rng: Rng, device: str, count: int) -> tuple[str, ...]:
    if device == "axis":
        return messy.mixture(rng, count)
    pool = [name for name in pose_cases.CAUSES if device == "mems" or name != "heat_crosstalk"]
    return tuple(rng.permutation(pool)[:count].tolist())


def make(kind: str, wanted: tuple[str, ...], seconds: float, rng: Rng) -> Made:
    """A case of the class `kind`: draws until every law has its size."""
    if kind == "null":
        return _null(wanted[0], seconds, rng)
    device, names = wanted[0], wanted[1:] if kind == "messy" else wanted[2:]
    rough = kind == "messy" or wanted[1] == "messy"
    low, high = messy.DOMINANT if rough else MEMORY
    make_one = _poses if device in pose_cases.MACHINES else _axis
    return until(lambda: make_one(device, names, rough, seconds, rng, (low, high)), wanted)


def until(once: Callable[[], Made], wanted: tuple[str, ...]) -> Made:
    """What `once` returns: tried until it raises no ValueError, which says that no amplitude has the wanted size on its bench."""
    for _ in range(TRIES):
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # a spring that softens too far
                return once()
        except ValueError:
            continue
    raise RuntimeError(f"no draw gave {wanted} the wanted size; widen the laws' shape values")


def _axis(device: str, names: tuple[str, ...], rough: bool, seconds: float, rng: Rng, sizes: Sizes) -> Made:
    servo = device == "servo"
    bench = servo_cases.draw_bench(rng, 5 * seconds) if servo else axis_cases.draw_bench(rng, seconds)
    bench = messy.unsettled(rng, bench) if rough else bench
    bench, planted, answer = on_axis(bench, device, names, rng, sizes, rough)
    return (lambda d: messy.write(d, bench, planted)), answer


def on_axis(
    bench: Bench,
    device: str,
    names: tuple[str, ...],
    rng: Rng,
    sizes: Sizes,
    rough: bool = False,
    draw: Callable[[str], Any] | None = None,
) -> tuple[Bench, list[Any], dict[str, Any]]:
    """Dominant causes `names`, and a background if `rough`: the bench, with a zero point of each record if `rough`, all laws, and the
    answer. `draw`: a law by its name. Raises ValueError where a law has not its size."""
    servo, (low, high) = device == "servo", sizes
    t = bench.fit
    ruler = Ruler(bench.axis, bench.scene, t.drive, t.start, t.ambient, t.noise, bench.linear)
    draw = draw or (lambda name: laws.draw(name, rng, bench.scene))
    top = min(high, messy.LARGEST_TRAVEL * bench.scene.travel / bench.scene.noise)
    found = messy.dominant(rng, draw, ruler, names, low, top)
    largest = max(size for _, size in found)
    pools = messy.ON_SERVO if servo else (messy.KNOWN, messy.FOREIGN)
    small = messy.background(rng, draw, ruler, largest, pools, names) if rough else []
    if rough:
        bench = messy.shifted(rng, bench, ZERO * largest * bench.scene.noise)
    truths = [_truth(p.name, _locations(p.name, servo), p.amplitude, p.shape, size) for p, size in found]
    rest = [_truth(p.name, _locations(p.name, servo), p.amplitude, p.shape, size) for p, size in small]
    known = messy.shares(bench, _laws(found), _laws(small), ruler)
    answer = axis_cases.describe(bench) | told(truths, rest, known, device, rough)
    return bench, _laws([*found, *small]), answer


def _laws(sized: list[tuple[Any, float]]) -> list[Any]:
    return [law for law, _ in sized]


def _locations(name: str, servo: bool) -> str:
    """Without inertia, what an axis does on its way to a place is the same at its actuator and at its stage."""
    at = laws.PLACE.get(name, "stage")
    return "stage:axis|actuator:axis" if servo and at == "stage" else f"{at}:axis"


def _truth(name: str, location: str, amplitude: float, shape: dict[str, Any], size: float) -> dict[str, Any]:
    return {"name": name, "location": location, "amplitude": amplitude, "shape": shape, "size": size}


def _poses(device: str, names: tuple[str, ...], rough: bool, seconds: float, rng: Rng, sizes: Sizes) -> Made:
    bench = pose_cases.draw_bench(rng, device, rough)
    bench, acts, dwell, answer = on_poses(bench, device, names, rng, sizes, rough)
    return (lambda d: pose_cases.write(d, bench, acts, dwell)), answer


def on_poses(
    bench: pose_cases.Bench, device: str, names: tuple[str, ...], rng: Rng, sizes: Sizes, rough: bool = False
) -> tuple[pose_cases.Bench, list[Any], bool, dict[str, Any]]:
    """As `on_axis`, of pose sets; and whether the recording says how long a pose was held."""
    gauge, (low, high) = pose_cases.PoseGauge(bench), sizes

    def draw(name: str) -> Any:
        return pose_cases.draw_act(name, rng, bench, gauge)

    found = messy.dominant(rng, draw, gauge, names, low, high)
    for act, _ in found:
        if act.amplitude > pose_cases.LARGEST.get(act.name, np.inf):
            raise ValueError(f"{act.name}: {act.amplitude:.2g} is another device")
    largest = max(size for _, size in found)
    small = messy.background(rng, draw, gauge, largest, (pose_cases.KNOWN, pose_cases.FOREIGN), names) if rough else []
    if rough:
        bench = pose_cases.shifted(rng, bench, gauge, ZERO * largest)
    truths = [_truth(a.name, a.location, a.amplitude * a.unit, a.shape, size) | {"also": a.also} for a, size in found]
    rest = [_truth(a.name, a.location, a.amplitude * a.unit, a.shape, size) | {"also": a.also} for a, size in small]
    known = pose_cases.shares(bench, _laws(found), _laws(small), gauge)
    creeps = any(memory.FAMILIES.get(name) == "creep" for name in names)
    dwell = creeps or bool(rng.uniform() < 0.3)
    answer = hexapod_cases.describe(bench.poses) | told(truths, rest, known, device, rough)
    return bench, _laws([*found, *small]), dwell, answer


def told(
    truths: list[dict[str, Any]], rest: list[dict[str, Any]], known: dict[str, Any], device: str, rough: bool
) -> dict[str, Any]:
    """The answer's part on what was planted: dominant causes by falling share.

    Raises ValueError where a cause hardly shows on the held-out record: it is not dominant there, and the caller draws again.
    """
    both = known["shares"], known["shares_varying"]
    if not all(max(pair) >= LEAST_SHARE for pair in zip(*both, strict=True)) or min(map(sum, both)) < LEAST_TOGETHER:
        raise ValueError("a cause that is not dominant on the held-out record")
    for k, truth in enumerate(truths):
        truth |= {"share": both[0][k], "share_varying": both[1][k], "family": memory.FAMILIES.get(truth["name"])}
        truth |= {"parts": known["parts"][k], "parts_varying": known["parts_varying"][k]}
    return {
        "planted": sorted(truths, key=lambda t: -t["share"]),
        "background": [*rest, ZEROS] if rough else rest,
        "device": device,
        "rough": rough,
        "least_error": known["least_error"],
        "mismatch": known["mismatch"],
        "before_parts": known["before_parts"],
        "before_parts_varying": known["before_parts_varying"],
    }


def _null(which: str, seconds: float, rng: Rng) -> Made:
    if which == "linear_hexapod":
        return _hexapod_series(seconds, rng)
    bench = axis_cases.draw_bench(rng, seconds, loop=which == "linear" and rng.uniform() < 0.15)
    sd = bench.scene.noise
    if which == "spikes":
        bench = _with_noise(bench, [messy.spiky(rng, t.noise, sd) for t in bench.takes])
    if which == "coloured":
        phi = float(rng.uniform(0.5, 0.9))
        bench = _with_noise(bench, [axis_cases.draw_noise(rng, sd, phi, len(t.drive)) for t in bench.takes])
        bench = replace(bench, noise_stated=True, noise_kind={"sd": sd, "phi": phi})
    if which in STATED:
        bench = replace(bench, noise_stated=True)
    if which == "linear":
        bench = replace(bench, linear=True)
    stated = STATED.get(which, 1.0)
    answer = axis_cases.describe(bench) | {"planted": [], "null": which, "device": "axis"}
    return (lambda d: axis_cases.write_bench(d, bench, [], stated=stated)), answer


def _with_noise(bench: Bench, noise: list[Any]) -> Bench:
    return replace(bench, takes=tuple(replace(t, noise=e) for t, e in zip(bench.takes, noise, strict=True)))


def _hexapod_series(seconds: float, rng: Rng) -> Made:
    """A series of the MEMS hexapod whose power is linear between samples: multisines to fit, filtered noise held out."""
    bench = hexapod_cases.draw_bench(rng)
    n, h = round(seconds / 5 / SERIES_PERIOD), SERIES_PERIOD
    shapes = {
        "fit": np.column_stack([axis_cases.multisine(rng, n, h, 1.0, 60.0) for _ in AXES]),
        "hold_out": np.column_stack([axis_cases.filtered_noise(rng, n, h, 20.0) for _ in AXES]),
    }
    drives = {role: np.round(0.25 + 0.2 * u, 6) for role, u in shapes.items()}
    noise = {role: rng.standard_normal(u.shape) * np.repeat(bench.sd, 3) for role, u in drives.items()}
    bench = replace(bench, drives=drives, noise=noise)
    plant = Hexapod(changed(read(), bench.shares))
    poses = {role: plant.series(u, h, linear=True) + noise[role] for role, u in drives.items()}
    columns = {f"P_{axis}": axis for axis in AXES}
    text = hexapod_cases.device_text()
    answer = hexapod_cases.describe(bench) | {"planted": [], "null": "linear_hexapod", "device": "mems"}
    return (lambda d: hexapod_cases.write_poses(d, text, "mems_hexapod", columns, "W", bench, poses, period=h)), answer
