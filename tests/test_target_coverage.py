"""The test that runs on the target enters every function of the generated C, every status, and the branches that can be entered."""

from __future__ import annotations

import gzip
import json
import re
import shutil
import subprocess
from functools import reduce
from operator import or_
from pathlib import Path

import pytest
from conftest import SCENARIOS, effect_device

from ctrlgen import ControllerStatus, build_model, generate, load_scenario, solve
from ctrlgen.controller.feedforward import Controller
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.toolchains import FLAGS
from ctrlgen.firmware.folder import CFolder
from ctrlgen.firmware.online.vector_cases import limiter_calls
from ctrlgen.firmware.online.vectors import vectors

# Share of the branches taken. What is left, by what stands in its line, cannot be entered or not for certain in float:
LEAST = {
    "circle20": 0.93,
    "mirror_spiral": 0.89,
    "rrr_circle": 0.92,
    "flexure_axis_line": 0.9,
    "meso_circle": 0.7,
    "tilt_platform": 0.9,
}
NEVER = {
    "meso_circle": {"limit_all", "is_nan"}
}  # its drives are its displacements, which are in range before: rounding alone can need them
QUICK = ("flexure_axis_line",)
NOT_ENTERED = (
    r"^const (float|double) t\d+ = ",  # which of two numbers is the larger, in a kernel of the physics
    r"^if \(worst > 1\.0\d+f?\)|^if \(scaled > 1\)",  # a stress within the slack of its limit
    r"^if \(limited != 0\)",  # the line search ends at a drive within the slack
    r"limit_all\(held, |high\[i\]\) > slack\[i\]",  # a drive beyond its limit within the slack: tests/test_limiter.py enters it
    r"^share = |^if \(share > 0|^if \(\w*drives_admissible",  # the origin of a line search, where the device is, has admissible drives
    r"^for \(i = 0; i < \d+; i\+\+\)",  # a loop behind one of those
    r"is_lost\(state\)|lost == 0|_LOST\)|drive_inside\(",  # drives that no displacement in range brings to a limit
    r"^if \(hit != 0\)|limit_state\(state, out|state_inside\(out",  # a displacement or state within the slack of its range, where
    # roundings of a float may change the status; farther out both are beyond, and the displacement is clipped first
    r"is_nan\(|unknown != 0",  # a root that has none: no target of these devices leads to one
    r"bits_of\(&value|bits_of\(&state",  # the same, the order in which axes leave their range, or numbers that were spoilt after it
    r"^if \(offset >= |^if \(segment >= count\)|next <= k",  # a knot between two samples, where pieces place them on samples; the
    # segment behind the last, which only rounding of a share just below one can reach; the sample before, on a path that is not closed
)


def solved(name: str, out: Path) -> tuple[CFolder, Controller]:
    scenario = load_scenario(SCENARIOS / name)
    model = build_model(scenario.device)
    controller = controller_of(model, scenario.file.follow, scenario.sample_time)
    return generate(scenario, model, out, solve(scenario, model)), controller


def branches(folder: CFolder, real: Real) -> tuple[list[str], dict[str, list[tuple[str, bool]]]]:
    """Functions never entered by the shipped test; and the branches of each function: the text of their line, whether taken."""
    sources = [*folder.sources(real), folder.runner(real)]
    strict = [flag for flag in FLAGS if flag != "-O2"]
    for source in sources:
        words = ["gcc", *strict, "-O0", "--coverage", "-I", folder.path, "-c", source]
        subprocess.run(words, cwd=folder.path, check=True)
    objects = [f"{source.stem}.o" for source in sources]
    subprocess.run(["gcc", "--coverage", *objects, "-o", "covered"], cwd=folder.path, check=True)
    subprocess.run(["./covered"], cwd=folder.path, check=True, capture_output=True)
    never: list[str] = []
    found: dict[str, list[tuple[str, bool]]] = {}
    for name in (folder.online[real], folder.player[real]):
        words = ["gcov", "--json-format", "--branch-probabilities", f"{name}.c"]
        subprocess.run(words, cwd=folder.path, check=True, capture_output=True)
        report = json.loads(gzip.decompress((folder.path / f"{name}.gcov.json.gz").read_bytes()))
        (file,) = (f for f in report["files"] if f["file"].endswith(f"{name}.c"))
        text = (folder.path / f"{name}.c").read_text().splitlines()
        never += [f["name"] for f in file["functions"] if not f["execution_count"]]
        for line in file["lines"]:
            taken = [(text[line["line_number"] - 1].strip(), branch["count"] > 0) for branch in line["branches"]]
            found.setdefault(line.get("function_name", ""), []).extend(taken)
    return never, found


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.long) for n in LEAST])
def test_the_shipped_test_enters_every_function_and_the_branches_that_can_be(name, tmp_path):
    for program in ("gcc", "gcov"):
        if not shutil.which(program):
            pytest.skip(f"{program} is missing: what the shipped test enters was not counted")
    folder, _ = solved(name, tmp_path)
    never, found = branches(folder, Real.FLOAT)
    assert {function.split("_f32_")[-1] for function in never} == NEVER.get(name, set())
    every = [taken for those in found.values() for _, taken in those]
    assert sum(every) >= LEAST[name] * len(every), (sum(every), len(every))
    missed = {text for name, those in found.items() if name not in never for text, taken in those if not taken}
    assert [text for text in sorted(missed) if not any(re.search(known, text) for known in NOT_ENTERED)] == []


@pytest.mark.long
@pytest.mark.parametrize("real", list(Real))
def test_the_vectors_have_every_status_that_a_target_can_bring_about(real):
    """INPUT and LOST have calls of their own beside the vectors."""
    for name, bits in (("circle20", 1 | 2 | 8 | 16), ("mirror_spiral", 1 | 4 | 8 | 16)):
        scenario = load_scenario(SCENARIOS / name)
        model = build_model(scenario.device)
        controller = controller_of(model, scenario.file.follow, scenario.sample_time)
        command = scenario.bind(model).targets
        rows = vectors(controller, command, real)["rows"]
        assert reduce(or_, (row["status"] for row in rows)) == bits
        stepped = reduce(or_, (row["status"] for row in rows if not row["how"] & 1))
        assert stepped & (bits & ~ControllerStatus.STATE) == bits & ~ControllerStatus.STATE


@pytest.mark.long
def test_a_device_whose_limits_have_no_cheap_bound_has_vectors_too():
    """With stages that yield less to the struts as they stiffen the wire stress is not of the first degree in the displacement."""
    model = build_model(effect_device({"kind": "link_load", "at": "all", "share": "1.15"}))
    controller = controller_of(model, "pose", 1e-3)
    assert controller.kernels.guarded_limits and controller.kernels.composite_bound is None
    fresh = controller_of(model, "pose", 1e-3)  # nothing of which is worked out yet
    assert {call.settle for call in limiter_calls(fresh, 2.0**-24, 8)} == {True, False}
