from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from ctrlgen import build_model, load_device, load_scenario, solve

ROOT = Path(__file__).resolve().parent.parent
SCENARIOS = ROOT / "scenarios"
DEVICE = SCENARIOS / "devices" / "mems_hexapod.toml"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="write codegen/golden anew instead of comparing")


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture(scope="session")
def device():
    return load_device(DEVICE)


@pytest.fixture(scope="session")
def model(device):
    return build_model(device)


@pytest.fixture(scope="session")
def circle():
    """The solved circle scenario."""
    scenario = load_scenario(SCENARIOS / "circle20")
    return solve(scenario, build_model(scenario.device))


@pytest.fixture(scope="session")
def compiler() -> str:
    """A C compiler; the tests that need one skip, saying so, where there is none."""
    for name in ("gcc", "clang", "cc"):
        if shutil.which(name):
            return name
    pytest.skip("no C compiler (gcc, clang or cc): the generated C was not built")


def effect_device(*effects: dict):
    """The MEMS hexapod with effects, as a device file with [[effect]] tables would give."""
    import tomllib

    from ctrlgen.devices import Device
    from ctrlgen.files import validate

    table = tomllib.loads(DEVICE.read_text())
    table["effect"] = list(effects)
    return validate(Device.library[table["kind"]], table, "device with effects")
