from __future__ import annotations

import os
import re
import shutil
import sys
from functools import wraps
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from package_programs import STRICT, run
from told_apart import alike_in_drawing

from battery.consistency import contradictions
from battery.first_screen_check import screen_contradictions
from ctrlgen import build_model, generate, load_device, load_scenario, solve
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.diagnosis_first_screen import diagnosis_first_screen
from ctrlgen.diagnosis.report.diagnosis_record import Provenance, diagnosis_record
from ctrlgen.firmware.folder import CFolder
from ctrlgen.trajectory.solution_plots import draw_solution

ROOT = Path(__file__).resolve().parent.parent
SCENARIOS = ROOT / "scenarios"
DEVICES = SCENARIOS / "devices"
# Measurements that may not be copied stand beside the repository, or nowhere: their tests are then skipped
RECORDINGS = ROOT.parent / "shared" / "recordings"
# A trial ends with any error, and so would every trial of a law that is wrongly written
ERROR_OF_CODE = re.compile(r"\b(?:TypeError|AttributeError|LookupError|KeyError|IndexError): ")
DEVICE, AXIS_FILE, MESO_FILE = (DEVICES / f"{name}.toml" for name in ("mems_hexapod", "flexure_axis", "meso_hexapod"))


# pytest-xdist uses the cores, and lines that run in a fork are not seen by coverage
os.environ.setdefault("CTRLGEN_JOBS", "1")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="write codegen/golden anew instead of comparing")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What is exhaustive is long too: `-m "not long"` leaves out both."""
    for item in items:
        if item.get_closest_marker("exhaustive"):
            item.add_marker("long")


@pytest.hookimpl
def pytest_collection_finish(session: pytest.Session) -> None:
    """Every diagnosis that a test makes in this process is held to the checkers of contradictions, wherever it is called from, and to no
    trial that ended in an error of code; every drawing to series that are told apart without their colour."""
    _holds_drawings()
    called = sys.modules.get("ctrlgen.diagnosis.diagnose")
    if called is None:
        return
    diagnose_recording = called.diagnose_recording

    @wraps(diagnose_recording)
    def checked(*args: Any, **options: Any) -> Diagnosis:
        found = diagnose_recording(*args, **options)
        record, screen = diagnosis_record(found, Provenance({}, 0)).as_json(), diagnosis_first_screen(found, {})
        wrong = [*contradictions(record), *screen_contradictions(record, screen.answer, screen.numbers, screen.steps)]
        wrong += [note for note in found.notes if ERROR_OF_CODE.search(note)]
        assert not wrong, "\n".join(wrong)
        return found

    for module in list(sys.modules.values()):
        if getattr(module, "diagnose_recording", None) is diagnose_recording:
            module.diagnose_recording = checked


def _holds_drawings() -> None:
    plots = sys.modules.get("ctrlgen.reporting.plots")
    if plots is None:
        return
    svg = plots.svg

    @wraps(svg)
    def checked(figure: Any) -> str:
        text = svg(figure)
        assert not (alike := alike_in_drawing(text)), f"told apart by their colour alone: {alike}"
        return text

    for module in list(sys.modules.values()):
        if getattr(module, "svg", None) is svg:
            module.svg = checked


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(7)


@pytest.fixture(scope="session")
def device():
    return load_device(DEVICE)


@pytest.fixture(scope="module")
def p(device) -> SimpleNamespace:
    """The numbers of `device`, SI; a module may have a `device` of its own."""
    return device.values()


@pytest.fixture(scope="session")
def model(device):
    return build_model(device)


@pytest.fixture(scope="session")
def circle():
    """The solved circle scenario."""
    scenario = load_scenario(SCENARIOS / "circle20")
    return solve(scenario, build_model(scenario.device))


@pytest.fixture(scope="session")
def circle_c(circle, tmp_path_factory) -> CFolder:
    """The C of the circle; who changes a file changes one of a copy."""
    return generate(circle.scenario, circle.model, tmp_path_factory.mktemp("circle_c"), circle)


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

    from ctrlgen.core.files import validate
    from ctrlgen.devices import Device

    table = tomllib.loads(DEVICE.read_text())
    table["effect"] = list(effects)
    return validate(Device.library[table["kind"]], table, "device with effects")


@pytest.fixture(scope="session")
def packages(tmp_path_factory, circle) -> dict[str, CFolder]:
    """Two different scenarios of two devices, solved."""
    scenario = load_scenario(SCENARIOS / "mirror_spiral")
    spiral = solve(scenario, build_model(scenario.device))
    out = tmp_path_factory.mktemp("packages")
    return {
        s.scenario.name: generate(s.scenario, s.model, out / s.scenario.name, s, draw_solution(s))
        for s in (circle, spiral)
    }


@pytest.fixture(scope="session")
def objects(packages, compiler, tmp_path_factory) -> dict[str, list[Path]]:
    """Scenario -> the objects of all its C at the root, in both arithmetics."""
    out = tmp_path_factory.mktemp("objects")
    built = {}
    for name, c in packages.items():
        built[name] = [out / f"{source.stem}.o" for source in sorted(c.path.glob("*.c"))]
        assert len(built[name]) == 8
        for made in built[name]:
            run(compiler, "-std=c99", *STRICT, "-O2", "-c", c.path / f"{made.stem}.c", "-o", made)
    return built


@pytest.fixture
def cpp(compiler) -> str:
    name = {"gcc": "g++", "clang": "clang++", "cc": "c++"}[compiler]
    if not shutil.which(name):
        pytest.skip(f"{name} is missing: nothing was built as C++; apt-get install g++")
    return name


@pytest.fixture
def cmake() -> str:
    if not shutil.which("cmake"):
        pytest.skip("cmake is missing: the CMake files were not run; apt-get install cmake")
    return "cmake"
