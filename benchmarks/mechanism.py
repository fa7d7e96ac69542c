"""A mechanism of sixty flexures: its Jacobian from the device file to machine code, and one evaluation of it."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from resource import RUSAGE_CHILDREN, RUSAGE_SELF, getrusage

import casadi as ca
import numpy as np

from benchmarks.measure import Line, Note, interleave, timed
from benchmarks.samples import Disagreement
from ctrlgen.devices import load_device
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.numerics import compiled, generated_c
from ctrlgen.physics.rigid_bodies import GROUND, point_force, point_motion
from ctrlgen.physics.screw import inverse_adjoint

BODIES = 30  # each on two wires
CALLS = 200
AGREE = 1e-8  # of the Jacobian's largest: the dense matrix loses some digits
AIM = 5.0  # s of processor time
HEAD = """kind = "mechanism"
name = "chain"
title = "bodies in a row, each on a wire to the ground and one to its neighbour"
source = "a benchmark"
[[material]]
name = "silicon"
young = "130 GPa"
poisson = "0.28"
"""
WIRE = """[[element]]
kind = "wire"
name = "{name}"
from = "{first}"
to = "b{k}"
at = ["{x} mm", "0 mm", "{z} mm"]
along = {along}
length = "4 mm"
diameter = "0.3 mm"
material = "silicon"
"""
PUSH = """[[actuator]]
name = "a{k}"
kind = "force"
on = "b0"
at = ["0 mm", "0 mm", "{z} mm"]
along = {along}
gain = "1 N/V"
low = "-1 V"
high = "1 V"
travel = "50 um"
"""
OUTPUT = '[output]\nbody = "b14"\nat = ["70 mm", "0 mm", "0 mm"]\nchannels = ["delta_x", "delta_z"]\n'


def run(repeat: int) -> list[Line | Note]:
    """Processor time up to the library, of ours and of the same function as CasADi writes it; wall time of one evaluation, of ours and
    of stiffnesses assembled and solved by numpy."""
    if compiled.compiler() is None:
        return [Note("mechanism: no C compiler here")]
    with tempfile.TemporaryDirectory(prefix="ctrlgen-bench-") as scratch:
        folder = Path(scratch)
        (folder / "chain.toml").write_text(_chain())
        made = {"ours": _made(folder, _in_parts), "peer": _made(folder, _as_casadi_writes_it)}
        seconds = interleave(made, min(repeat, 3))
        ours = ca.external("mechanism", str(folder / f"{_in_parts.__name__}.so"))
        dense, diameters = _dense(folder), np.random.default_rng(1).uniform(0.2e-3, 0.4e-3, 2 * BODIES)
        found, wanted = ours(diameters).full(), dense(diameters)
        if np.abs(found - wanted).max() > AGREE * np.abs(wanted).max():
            raise Disagreement(f"the mechanism's Jacobian is {found}, by numpy {wanted}")
        calls = {
            "ours": timed(lambda: [ours(diameters) for _ in range(CALLS)], CALLS),
            "peer": timed(lambda: dense(diameters)),
        }
        one = interleave(calls, repeat)
    return [
        Line("60 elements to machine code, CPU", seconds["ours"], "CasADi's C, one function", seconds["peer"], AIM),
        Line("one Jacobian of them", one["ours"], "numpy, all bodies", one["peer"]),
    ]


def _chain() -> str:
    text = HEAD + "".join(f'[[body]]\nname = "b{k}"\n' for k in range(BODIES))
    for k in range(BODIES):
        text += WIRE.format(name=f"up{k}", first="ground", k=k, x=5 * k, z=0, along="[0, 1, 0]")
        text += WIRE.format(name=f"on{k}", first=f"b{k - 1}" if k else "ground", k=k, x=5 * k, z=1, along="[1, 0, 0]")
    return text + PUSH.format(k=0, z=0, along="[1, 0, 0]") + PUSH.format(k=1, z=3, along="[0, 0, 1]") + OUTPUT


def _assembled(folder: Path) -> tuple[Condensed, ca.SX]:
    """The mechanism with every diameter a symbol."""
    device = load_device(folder / "chain.toml")
    paths = [path for path, _ in device.quantities() if path.startswith("element") and path.endswith("diameter")]
    symbols = {path: ca.SX.sym(path) for path in paths}
    return Condensed(device, device.values(symbols)), ca.vertcat(*symbols.values())


def _made(folder: Path, compile_it: Callable[[ca.Function, Path], None]) -> Callable[[], float]:
    """A contender: processor time from the device file to a library."""

    def spent() -> float:
        return sum(getrusage(whose).ru_utime for whose in (RUSAGE_SELF, RUSAGE_CHILDREN))

    def contender() -> float:
        start = spent()
        mechanism, p = _assembled(folder)
        compile_it(ca.Function("mechanism", [p], [mechanism.jacobian], {"cse": True}), folder)
        return spent() - start

    return contender


def _in_parts(function: ca.Function, folder: Path) -> None:
    _compile(generated_c.casadi_c(function), folder / f"{_in_parts.__name__}.so")


def _as_casadi_writes_it(function: ca.Function, folder: Path) -> None:
    generator = ca.CodeGenerator("whole.c")
    generator.add(function)
    generator.generate(f"{folder}/")
    _compile((folder / "whole.c").read_text(), folder / f"{_as_casadi_writes_it.__name__}.so")


def _dense(folder: Path) -> Callable[[np.ndarray], np.ndarray]:
    """Diameters -> the Jacobian by numpy: all bodies' stiffness (6 n, 6 n) assembled and solved for the actuators' forces."""
    mechanism, p = _assembled(folder)
    device, n = mechanism.device, 6 * BODIES
    stiffness = ca.Function("stiffness", [p], [ca.densify(ca.horzcat(*(e.stiffness for e in mechanism.elements)))])
    loads, travel = np.zeros((n, 2)), np.zeros((2, n))
    for i, (a, direction) in enumerate(zip(device.placed_actuators, mechanism.directions, strict=True)):
        own = slice(6 * a.second, 6 * a.second + 6)
        loads[own, i] = ca.DM(point_force(mechanism.point(a), direction)).full()[:, 0]
        travel[i, own] = ca.DM(point_motion(mechanism.point(a), direction)).full()[0]
    body = device.bodies.index(device.output.body)
    moved = ca.DM(inverse_adjoint(None, mechanism.output_point)).full()[3::2]  # delta_x, delta_z

    def jacobian(diameters: np.ndarray) -> np.ndarray:
        K = np.zeros((n, n))
        for e, own in zip(mechanism.elements, np.hsplit(stiffness(diameters).full(), 2 * BODIES), strict=True):
            ends = [slice(6 * b, 6 * b + 6) for b in (e.first, e.second) if b != GROUND]
            for i in ends:
                for j in ends:
                    K[i, j] += own if i == j else -own
        twists = np.linalg.solve(K, loads)
        per_force = moved @ twists[6 * body : 6 * body + 6]
        return per_force @ np.linalg.inv(travel @ twists)

    return jacobian


def _compile(code: str, library: Path) -> None:
    """Compiles a peer with the flags of ours. Raises Disagreement."""
    source = library.with_suffix(".c")
    source.write_text(code)
    command = [str(compiled.compiler()), *compiled.FLAGS, str(source), "-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Disagreement(f"{' '.join(command)} ended with {done.returncode}:\n{done.stderr[-2000:]}")
