"""The fastest law along a path: IPOPT in time (`ctrlgen fastest`), against TOPP-RA on what both can state.

Two axes on a flexure follow a spiral from rest to rest. "rates": drives that move them may change only so fast, which bounds each axis's
speed. "forces": they have a mass, and forces are bounded: with the flexure's own force of the position, a bound on acceleration. TOPP-RA
(H. Pham, Q.-C. Pham, IEEE Trans. Robotics 34 (2018) 645) cannot state damping, lags and the rates of held drives.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

import ctrlgen
from benchmarks.measure import Line, Note, interleave
from benchmarks.samples import Disagreement
from ctrlgen import build_model, load_scenario
from ctrlgen.path_timing.curve import Curve
from ctrlgen.path_timing.optimum import Optimiser

try:
    import toppra
    import toppra.algorithm
    import toppra.constraint
except ImportError:
    toppra = None

NAME = "TOPP-RA 0.6"
MASS, STIFFNESS, FORCE, SPEED = 0.5, 0.2e6, 40.0, 0.05  # kg, N/m, N, m/s
RATE = 200e3  # Hz: drives that samples can show; at such a rate a bang of force is one
KNOTS, GRID = 1001, 1000  # of the spline that TOPP-RA is given, and of its own grid
SLOWER, FASTER = 1.02, 0.995  # durations over TOPP-RA's between which the answers are those of one problem
SCENARIO = """title = "spiral"
device = "stage"
sample_rate = "{rate} Hz"
duration = "0.1 s"
[path]
kind = "spiral"
diameter = "40 um"
turns = 2
centre = {{ x = "30 um", y = "30 um" }}
plane = ["x", "y"]
"""


@dataclass(frozen=True)
class Case:
    """What one is told of the stage, and the constraint that says the same to TOPP-RA."""

    name: str
    words: dict[str, Any]
    constraint: Callable[[], Any]


def _forces() -> Any:
    limits = np.tile([-FORCE, FORCE], (2, 1))
    return toppra.constraint.JointTorqueConstraint(
        lambda q, _, acceleration: MASS * acceleration + 1e-6 * STIFFNESS * q, limits, np.zeros(2)
    )


CASES = (
    Case(
        "rates",
        {
            "drive": {"x": "100 N", "y": "100 N"},
            "drive_rate": {axis: f"{STIFFNESS * SPEED:g} N/s" for axis in "xy"},
        },
        lambda: toppra.constraint.JointVelocityConstraint(1e3 * np.tile([-SPEED, SPEED], (2, 1))),
    ),
    Case("forces", {"drive": {"x": f"{FORCE} N", "y": f"{FORCE} N"}, "mass": lambda p: [p.m, p.m]}, _forces),
)


def run(repeat: int) -> list[Line | Note]:
    """Processor time of the law of each case, and how long the motions take."""
    if toppra is None:
        return [Note("topp: left out, TOPP-RA is not installed: pip install 'ctrlgen[bench]'")]
    results: list[Line | Note] = []
    for case in CASES:
        ours, peer = _ours(case), _peer(case)
        took = {"ours": ours(), "peer": peer()}
        if not FASTER < took["ours"] / took["peer"] < SLOWER:
            raise Disagreement(f"{case.name}: {took['ours']:.6g} s by ctrlgen, {took['peer']:.6g} s by TOPP-RA")
        seconds = interleave({"ours": _spent(ours), "peer": _spent(peer)}, repeat)
        results.append(Line(f"fastest law, bounds on {case.name}", seconds["ours"], NAME, seconds["peer"]))
        told = f"{1e3 * took['ours']:.5g} ms, by TOPP-RA {1e3 * took['peer']:.5g} ms"
        results.append(Note(f"topp, {case.name}: the motion takes {told} (ratio {took['ours'] / took['peer']:.4f})"))
    return results


def _curve(case: Case) -> Curve:
    device = ctrlgen.user_device(
        "stage",
        parameters={"m": f"{MASS} kg", "k": f"{STIFFNESS} N/m"},
        axes={"x": ("0 um", "60 um"), "y": ("0 um", "60 um")},
        force=lambda u, p: u.vector,
        restoring_force=lambda d, p: p.k * d.vector,
        **case.words,
    )
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "scenario.toml").write_text(SCENARIO.format(rate=f"{RATE:g}"))
        scenario = load_scenario(folder, device)
    return Curve(scenario, build_model(device))


def _ours(case: Case) -> Callable[[], float]:
    curve = _curve(case)

    def found() -> float:
        return Optimiser(curve.model, curve.scenario.file.follow, 1 / RATE).along(curve).duration

    return found


def _peer(case: Case) -> Callable[[], float]:
    share = np.linspace(0, 1, KNOTS)
    # In um and ms, in which its numbers are of order one: the mass is the same number
    path = toppra.SplineInterpolator(share, 1e6 * _curve(case).samples(share))

    def found() -> float:
        law = toppra.algorithm.TOPPRA([case.constraint()], path, gridpoints=np.linspace(0, 1, GRID + 1))
        motion = law.compute_trajectory(0, 0)
        if motion is None:
            raise Disagreement(f"{case.name}: TOPP-RA finds no law")
        return 1e-3 * float(motion.duration)

    return found


def _spent(work: Callable[[], float]) -> Callable[[], float]:
    def run() -> float:
        begin = process_time()
        work()
        return process_time() - begin

    return run
