"""The player: the shorter of table and cubic within a tolerance of what is followed, the same numbers in C and in any order of calls."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from conftest import DEVICE, SCENARIOS

from ctrlgen import build_model, load_scenario, solve
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.toolchains import FLAGS
from ctrlgen.firmware.folder import generate
from ctrlgen.firmware.player import spline
from ctrlgen.firmware.player.compression import INSTRUCTION_BUDGET, TOLERANCE_SHARE, compress, instructions
from ctrlgen.model.simulation import simulate
from ctrlgen.trajectory.playback import ANGLE_TOLERANCE, LENGTH_TOLERANCE

pytestmark = pytest.mark.long

KINDS = ["closed", "raster", "limited", "short", "single", "three drives"]


def driven(solution, drive):
    """A closed solution that holds `drive`; its command is what the model follows in the second lap."""
    scenario, start, n = solution.scenario, solution.trace, len(drive)
    reached = simulate(solution.model, np.vstack([drive] * 8), scenario.sample_time, start.x[0], start.z[0])
    trace = replace(reached, x=reached.x[7 * n :], z=reached.z[7 * n :])
    return replace(solution, command=reached.signals[scenario.file.follow][7 * n : 8 * n], trace=trace, drive=drive)


def line(tmp_path, samples, end="1 um"):
    """An open path, at rest at both ends."""
    path = tmp_path / "line.toml"
    path.write_text(f"""title = "line"
device = "{DEVICE}"
sample_rate = "1 kHz"
duration = "{samples} ms"
[path]
kind = "line"
start = {{ delta_z = "20 um" }}
end = {{ delta_x = "{end}", delta_z = "20 um" }}
""")
    scenario = load_scenario(path)
    return solve(scenario, build_model(scenario.device))


def first_sample(solution):
    """The path of its first sample alone."""
    return replace(solution, drive=solution.drive[:1], command=solution.command[:1])


@pytest.fixture(scope="module")
def solutions(circle, tmp_path_factory):
    raster = load_scenario(SCENARIOS / "raster")
    short = line(tmp_path_factory.mktemp("line"), 7)
    still = line(tmp_path_factory.mktemp("still"), 2, "0 um")
    ring = load_scenario(SCENARIOS / "rrr_circle")
    high = np.minimum(circle.drive * [1, 1, 1, 0.8, 1, 0.8], 0.2)  # one heater as hot as the device bears, for a while
    model = replace_bounds(circle.model, 0.0, 0.2)
    return {
        "closed": circle,
        "raster": solve(raster, build_model(raster.device)),
        "limited": driven(replace(circle, model=model), high),
        "short": short,
        "single": first_sample(still),
        "three drives": solve(ring, build_model(ring.device)),
    }


def replace_bounds(model, low, high):
    """The model with other limits of its drives."""
    limits = tuple(
        replace(li, lower=low, upper=high) if li.expr.is_symbolic() or is_drive(model, li) else li
        for li in model.limits
    )
    return replace(model, limits=limits)


def is_drive(model, limit):
    return limit.expr.numel() == model.u.numel() and all(
        limit.expr[i].element_hash() == model.u[i].element_hash() for i in range(model.u.numel())
    )


@pytest.fixture(scope="module")
def compressions(solutions):
    return {kind: compress(solution) for kind, solution in solutions.items()}


def off(solution, drives):
    """The worst [m], [rad] over a lap (two where the path is closed), of the pose."""
    laps = np.vstack([drives, drives]) if solution.scenario.closed else drives
    command = np.vstack([solution.command] * (2 if solution.scenario.closed else 1))
    start = solution.trace
    signal = simulate(solution.model, laps, solution.scenario.sample_time, start.x[0], start.z[0]).signals["pose"]
    worst = np.abs(signal[: len(command)] - command).max(axis=0)
    linear = [u.endswith("m") for u in solution.model.signals["pose"].units]
    return worst[linear].max(), worst[np.logical_not(linear)].max()


@pytest.mark.parametrize("real", list(Real))
@pytest.mark.parametrize("kind", KINDS)
def test_what_the_chosen_curve_follows_is_within_the_tolerance_and_what_is_recorded(
    solutions, compressions, kind, real
):
    chosen = compressions[kind][real]
    length, angle = off(solutions[kind], chosen.drives(np.arange(len(solutions[kind].drive))))
    assert length <= 0.1e-9 and angle <= 1e-8
    assert length <= chosen.chosen.length * 1.001 + 1e-15 and angle <= chosen.chosen.angle * 1.001 + 1e-13


@pytest.mark.parametrize("real", list(Real))
@pytest.mark.parametrize("kind", KINDS)
def test_the_choice_is_the_shortest_within_tolerance_and_budget_and_both_are_recorded(compressions, kind, real):
    c = compressions[kind][real]
    assert [x.kind for x in c.candidates] == ["table", "cubic"]
    assert sum(x.chosen for x in c.candidates) == 1 and all(x.remark for x in c.candidates)
    good = [
        x
        for x in c.candidates
        if x.bytes
        and x.instructions <= INSTRUCTION_BUDGET
        and x.length <= TOLERANCE_SHARE * LENGTH_TOLERANCE
        and x.angle <= TOLERANCE_SHARE * ANGLE_TOLERANCE
    ]
    assert c.chosen.bytes == min(x.bytes for x in good) == c.curve.bytes(real)
    assert c.chosen.remark == "fewest bytes"
    assert all(x.chosen or x.remark == f"more bytes than the {c.chosen.kind}" for x in good)


def test_a_smooth_circle_takes_a_thirtieth_of_the_table_and_a_short_path_the_table(compressions):
    circle = compressions["closed"][Real.FLOAT]
    assert circle.chosen.kind == "cubic" and 30 * circle.chosen.bytes < circle.candidates[0].bytes
    assert compressions["raster"][Real.FLOAT].chosen.kind == "cubic"
    for kind in ("short", "single"):
        assert compressions[kind][Real.FLOAT].chosen.kind == "table"


def test_pieces_begin_where_a_drive_reaches_or_leaves_its_limit(solutions):
    solution = solutions["limited"]
    held = np.hstack([solution.drive == 0.0, solution.drive == 0.2])
    changes = np.flatnonzero(np.any(held[1:] != held[:-1], axis=1)) + 1
    low, high = solution.model.u_bounds
    assert changes.size == 2 and spline.switches(solution.drive, low, high) == changes.tolist()
    fitted = spline.fit(solution.drive, low, high, np.full(6, 1e-6), True)
    assert set(changes) <= {p.start for p in fitted.pieces}
    assert np.abs(fitted.values(Real.DOUBLE) - solution.drive).max() < 1.001e-6


@pytest.mark.parametrize("real", list(Real))
def test_drives_stay_inside_their_limits_between_samples_too(solutions, compressions, real):
    c, n = compressions["limited"][real], len(solutions["limited"].drive)
    for part in (0.0, 0.25, 0.5, 0.999):
        drives = c.drives(np.arange(n), np.full(n, part))
        assert drives.min() >= 0.0 and drives.max() <= np.float64(0.2)
    assert c.chosen.kind == "cubic" and np.isfinite(c.high).any()  # so the C has a limit to keep


def test_a_kink_is_cheaper_by_pieces():
    k = np.arange(200.0)
    drive = np.column_stack([np.abs(k - 77.5) * (1 + 1e-3 * k), k])
    bounds = np.full(2, -np.inf), np.full(2, np.inf)
    curve = spline.fit(drive, *bounds, np.array([1e-3, 1e-3]), False)
    assert 78 in [p.start for p in curve.pieces] and len(curve.control) < 20
    assert np.abs(curve.values(Real.DOUBLE) - drive).max() <= 1.001e-3


def test_the_piece_of_every_sample_is_found(solutions):
    curve = spline.fit(solutions["raster"].drive, np.zeros(6), np.ones(6), np.full(6, 1e-5), False)
    for k in range(curve.samples):
        first = curve.blocks[k >> curve.block_bits]
        piece = curve.pieces[first + (k >= curve.pieces[first].stop)]
        assert piece.start <= k < piece.stop


MAIN = """
#include "{p}.h"
#include <stdio.h>
#include <stdlib.h>
int main(int count, char **words)
{{
    {real} u[{n}];
    int k;
    for (k = 2; k < count; k++) {{
        int i;
        const uint32_t index = (uint32_t)strtoul(words[k], NULL, 10);
        const unsigned status = (words[1][0] == 's') ? {p}_sample(index, u) : {p}_at(({real})strtod(words[k], NULL), u);
        (void)printf("%u", status);
        for (i = 0; i < {n}; i++) {{ (void)printf(" %.17g", (double)u[i]); }}
        (void)printf("\\n");
    }}
    return 0;
}}
"""


@pytest.fixture(scope="module")
def played(solutions, compiler, tmp_path_factory):
    """Calls the C of a kind and arithmetic: ('sample' or 'at', arguments) -> (status, drives)."""
    programs = {}

    def play(kind, real, mode, arguments):
        if kind not in programs:
            out = tmp_path_factory.mktemp("player")
            solution = solutions[kind]
            folder = generate(solution.scenario, solution.model, out, solution)
            programs[kind] = {}
            for r, name in folder.player.items():
                n = solution.drive.shape[1]
                (out / f"main_{name}.c").write_text(MAIN.format(p=name, real=r.value, n=n))
                safe = ["-fsanitize=undefined", "-fno-sanitize-recover=all"] if compiler in ("gcc", "clang") else []
                command = [
                    compiler,
                    *FLAGS,
                    *safe,
                    f"-I{out}",
                    out / f"main_{name}.c",
                    out / f"{name}.c",
                    "-o",
                    out / name,
                ]
                done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
                assert done.returncode == 0, done.stderr
                programs[kind][r] = out / name
        words = [str(programs[kind][real]), mode, *map(str, arguments)]
        done = subprocess.run(words, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        rows = np.array([line.split() for line in done.stdout.splitlines()], dtype=float)
        return rows[:, 0].astype(int), rows[:, 1:]

    return play


@pytest.mark.parametrize("real", list(Real))
@pytest.mark.parametrize("kind", KINDS)
def test_the_c_answers_what_numpy_does_bit_for_bit_in_any_order(solutions, compressions, played, kind, real):
    n = len(solutions[kind].drive)
    status, forward = played(kind, real, "sample", range(n))
    assert not status.any()
    order = np.random.default_rng(5).permutation(n)
    assert np.array_equal(played(kind, real, "sample", order)[1], forward[order])
    exact = compressions[kind][real].drives(np.arange(n))
    # a processor that fuses a product and a sum rounds once less
    size = np.abs(exact).max()
    assert np.array_equal(forward, exact) or np.abs(forward - exact).max() < 8 * size * (
        6e-8 if real is Real.FLOAT else 1e-16
    )


@pytest.mark.parametrize("real", list(Real))
@pytest.mark.parametrize("kind", KINDS)
def test_the_index_wraps_or_ends(solutions, played, kind, real):
    n, closed = len(solutions[kind].drive), solutions[kind].scenario.closed
    whole = 2**32 // n * n
    asked = [n - 1, n, n + 1, 5 * n, whole - 1]
    status, drives = played(kind, real, "sample", asked)
    _, expected = played(kind, real, "sample", [k % n if closed else n - 1 for k in asked])
    assert np.array_equal(drives, expected)
    assert status.tolist() == ([0] * 5 if closed else [0, 1, 1, 1, 1])
    if whole < 2**32:  # the round that the index does not complete: held where the next one begins
        status, drives = played(kind, real, "sample", [whole, 2**32 - 1])
        assert np.array_equal(drives, played(kind, real, "sample", [0 if closed else n - 1] * 2)[1])
        assert status.tolist() == ([16, 16] if closed else [1, 1])


@pytest.mark.parametrize("real", list(Real))
@pytest.mark.parametrize("kind", KINDS)
def test_times_that_are_none_are_refused_and_others_follow_the_curve(solutions, compressions, played, kind, real):
    solution = solutions[kind]
    n, h, closed = len(solution.drive), solution.scenario.sample_time, solution.scenario.closed
    status, drives = played(kind, real, "at", ["nan", "-1e-9", "-inf", "inf", "1e30", n * h * 1.01])
    assert status.tolist() == ([16] * 6 if closed else [16, 16, 16, 1, 1, 1])
    low, high = solution.model.u_bounds
    assert np.all((drives >= low) & (drives <= high))
    if not closed:
        assert np.array_equal(drives[3:], np.tile(played(kind, real, "sample", [n - 1])[1], (3, 1)))
    k = np.arange(0, n - 1, max(1, n // 50))
    if k.size:
        status, drives = played(kind, real, "at", [(i + 0.8) * h for i in k])
        expected = compressions[kind][real].drives(k, np.full(len(k), 0.3))
        steepest = np.abs(np.diff(solution.drive, axis=0)).max()
        eps = 6e-8 if real is Real.FLOAT else 1e-16
        assert not status.any() and np.abs(drives - expected).max() < 16 * eps * (1 + n * steepest)
    at_start = played(kind, real, "at", [0.0, 0.5 * h])
    assert not at_start[0].any()
    first = compressions[kind][real].drives(np.array([0]))
    assert np.abs(at_start[1][1] - first).max() < 1e-5 * (1 + np.abs(first).max())


def test_the_header_compares_table_and_cubic(solutions, tmp_path):
    solution = solutions["closed"]
    folder = generate(solution.scenario, solution.model, tmp_path, solution)
    text = (tmp_path / f"{folder.player[Real.FLOAT]}.h").read_text()
    for kind in ("table", "cubic"):
        assert re.search(rf"\*   {kind} .*bytes.*operations.*instructions.*nm.*rad; \S", text), kind
    assert text.count("chosen: ") == 1


def test_more_drives_pieces_and_limits_cost_more_instructions():
    k = np.arange(200.0)[:, None]
    free = np.full(2, -np.inf), np.full(2, np.inf)
    one = spline.fit(np.sin(k / 30), free[0][:1], free[1][:1], np.array([1e-3]), False)
    two = spline.fit(np.hstack([np.sin(k / 30)] * 2), *free, np.full(2, 1e-3), False)
    bent = spline.fit(np.hstack([np.abs(k - 77.5)] * 2), *free, np.full(2, 1e-3), False)
    assert len(one.pieces) == len(two.pieces) == 1 < len(bent.pieces)
    assert instructions(one, 0) < instructions(two, 0) < instructions(bent, 0) < instructions(bent, 1)
    assert one.operations + 7 == two.operations < bent.operations
