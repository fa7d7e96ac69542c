"""A turntable on a stage whose scenario states corrections, made up for the tests of them."""

from __future__ import annotations

from pathlib import Path

from ctrlgen import build_model, load_scenario
from ctrlgen.controller.correction import Corrections
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.folder import CFolder, generate
from ctrlgen.firmware.online.corrected import corrections_of, mark_of
from ctrlgen.trajectory.scenario import Scenario

DEVICE = """
kind = "matrix"
name = "table"
title = "turntable on a stage"
source = "made up for this test"
directions = ["delta_x", "theta_z"]
jacobian = [["0.2 um/V", "10 nm/V"], ["1 urad/V", "400 urad/V"]]
channels = ["delta_x", "theta_z"]

[[actuator]]
name = "push"
low = "-100 V"
high = "100 V"

[[actuator]]
name = "turn"
low = "-100 V"
high = "100 V"
"""
SCENARIO = """
title = "to and fro"
device = "device.toml"
sample_rate = "1 kHz"
duration = "20 ms"

[path]
kind = "line"
end = { theta_z = "20 mrad" }
"""
RUNOUT_TABLE = """
[[correction]]
of = "delta_x"
over = "theta_z"
kind = "table"
period = "10 mrad"
entries = 32
bound = "0.5 um"
"""
RIPPLE = """
[[correction]]
of = "theta_z"
kind = "harmonic"
period = "10 mrad"
harmonics = 5
bound = "50 urad"
"""
OPEN_TABLE = RUNOUT_TABLE.replace('period = "10 mrad"', 'range = ["-12 mrad", "15 mrad"]')


def stated(folder: Path, *sections: str) -> Scenario:
    """The turntable's scenario with these corrections."""
    folder.mkdir(exist_ok=True)
    (folder / "device.toml").write_text(DEVICE)
    (folder / "scenario.toml").write_text(SCENARIO + "".join(sections))
    return load_scenario(folder / "scenario.toml")


def made(folder: Path, *sections: str) -> tuple[CFolder, Corrections, int]:
    scenario = stated(folder, *sections)
    model = build_model(scenario.device)
    corrections = corrections_of(scenario, controller_of(model, "pose", scenario.sample_time).kernels)
    assert corrections is not None
    return generate(scenario, model, folder / "c"), corrections, mark_of(scenario, corrections)
