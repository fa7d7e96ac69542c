"""constants.h in a firmware: beside the C of another device file, or the constants of another specimen, it does not compile."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest
from conftest import SCENARIOS

from ctrlgen import build_model, generate, load_device, load_scenario
from ctrlgen.calibration.calibrate import CalibratedConstant, Determination
from ctrlgen.calibration.constants_files import write_constants
from ctrlgen.firmware.c.real import Real

DEVICE = SCENARIOS / "devices" / "mems_hexapod_run_time.toml"


def specimen(path: Path, share: float, told: str = "") -> Path:
    """The folder `path` with the constants of a specimen, `share` of the way from the lowest to the highest; of another device file
    where its text has `told` behind it."""
    device = load_device(DEVICE)
    rows = [
        CalibratedConstant(c, c.low + share * (c.high - c.low), 1e-3 * c.low, Determination.DETERMINED)
        for c in device.given_at_start
    ]
    files = {"device": SimpleNamespace(text=DEVICE.read_text() + told)}
    title = SimpleNamespace(title="a specimen")
    path.mkdir()
    write_constants(path, SimpleNamespace(device=device, inputs=files, recording=title, constants=rows))
    return path / "constants.h"


@pytest.fixture(scope="module")
def headers(tmp_path_factory) -> dict[str, Path]:
    """Of the controller, of one under a name of its own, and of two specimens and one of another device file."""
    home = tmp_path_factory.mktemp("specimens")
    text = (SCENARIOS / "circle20" / "scenario.toml").read_text().replace("../devices/mems_hexapod.toml", str(DEVICE))
    found = {}
    for name, own in (("controller", ""), ("named", 'controller = "fast"\n')):
        (home / f"{name}.toml").write_text(own + text)
        scenario = load_scenario(home / f"{name}.toml")
        made = generate(scenario, build_model(scenario.device), home / name)
        found[name] = made.path / f"{made.online[Real.FLOAT]}.h"
    found |= {"one": specimen(home / "one", 0.3), "other": specimen(home / "other", 0.6)}
    return found | {"foreign": specimen(home / "foreign", 0.3, "\n# of another device\n")}


@pytest.mark.parametrize(
    ("read", "told"),
    [
        ("one controller", ""),
        ("controller one", ""),
        ("controller one one", ""),
        ("one named", ""),
        ("foreign controller", "belongs to another device file"),
        ("controller foreign", "belong to another device file"),
        ("foreign named", "belongs to another device file"),
        ("controller one other", "two specimens of mems_hexapod_specimen"),
        ("one other controller", "two specimens of mems_hexapod_specimen"),
    ],
)
def test_constants_that_are_not_those_of_the_controller_do_not_compile_in_any_order(
    headers, compiler, tmp_path, read, told
):
    """Read before the controller's header, constants of any device file were taken; of two specimens the first were those of both."""
    source = tmp_path / "firmware.c"
    source.write_text("".join(f'#include "{headers[name]}"\n' for name in read.split()))
    done = subprocess.run(
        [compiler, "-std=c99", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", source], capture_output=True, text=True
    )
    assert (done.returncode != 0) == bool(told) and re.search(told, done.stderr), done.stderr
