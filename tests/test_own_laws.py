"""A law in a package of its user: found by its entry point, used like ours, or left out and said why."""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib
from importlib.metadata import distributions
from pathlib import Path

import numpy as np
import pytest
from axis_records import AXIS, NOISE, axis_fitter, drive, move, record
from conftest import AXIS_FILE, ROOT
from markdown_it import MarkdownIt
from recovery import N, Planted, fitter_of, recover

from ctrlgen import InputError, build_model, load_device, simulate, version
from ctrlgen.diagnosis.selection.objections import another_law
from ctrlgen.effects import Effect, installed, load_laws
from ctrlgen.estimation.hypothesis import Hypothesis, selected_laws
from ctrlgen.estimation.structure import Structure

ON_AXIS = """
[[effect]]
kind = "slack_cable"
{package}
at = "axis"
stiffness = "20 N/mm"
gap = "30 um"
"""


def install(folder: Path, name: str, points: dict[str, str], **modules: str) -> None:
    """What `pip install` leaves of a package: its modules and a .dist-info."""
    info = folder / f"{name.replace('-', '_')}-0.1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 0.1\n")
    lines = [f"{kind} = {value}" for kind, value in points.items()]
    (info / "entry_points.txt").write_text("\n".join(["[ctrlgen.laws]", *lines, ""]))
    for module, text in modules.items():
        (folder / f"{module}.py").write_text(text)


def of_the_page() -> dict[str, str]:
    """The files that docs/howto/own_law.md has its reader write."""
    files = {}
    for token in MarkdownIt().parse((ROOT / "docs" / "howto" / "own_law.md").read_text()):
        head, _, text = token.content.partition("\n\n")
        if token.type == "fence" and head.startswith(":caption:"):
            files[head.removeprefix(":caption:").strip()] = text
    return files


@pytest.fixture(autouse=True)
def library():
    """The library, the installed packages and their modules are afterwards as they were."""
    before, modules = dict(Effect.library), set(sys.modules)
    installed.cache_clear()
    yield
    Effect.library.clear()
    Effect.library.update(before)
    installed.cache_clear()
    for name in set(sys.modules) - modules:
        if name.partition(".")[0] in ("my_stage", "gone") or name.startswith("law_"):
            del sys.modules[name]


@pytest.fixture
def page(tmp_path, monkeypatch) -> Path:
    """A folder in which the package of the page is installed."""
    files = of_the_page()
    points = tomllib.loads(files.pop("pyproject.toml"))["project"]["entry-points"]["ctrlgen.laws"]
    install(tmp_path, "my-stage", points)
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def loaded(folder: Path, monkeypatch) -> tuple[dict[str, type[Effect]], list]:
    monkeypatch.syspath_prepend(str(folder))
    return load_laws([p for d in distributions(path=[str(folder)]) for p in d.entry_points])


def ctrlgen(*words: object) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own, which finds what this one finds."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-m", "ctrlgen", *map(str, words)]
    return subprocess.run(command, env=environment, capture_output=True, text=True)


def test_a_diagnosis_finds_it_with_its_numbers(page):
    """Planted in a simulator that has its own cable."""
    assert "slack_cable" not in Effect.library
    assert {law.kind for law in selected_laws()} == {*Effect.library} >= {"slack_cable"}
    rng, parts = np.random.default_rng(3), []
    for u, role in ((drive(N), "fit"), (drive(N, slow=1.2, fast=0.5), "hold_out")):
        y = move(u, lambda t, q, v, memory: (-2e4 * max(q - 3e-5, 0.0), memory))
        parts.append(record(u, y + NOISE * rng.standard_normal(N), role))
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (NOISE,), "series", parts)
    recover(fitter, AXIS, "slack_cable", Planted("stage:axis", {"stiffness": 2e4, "gap": 3e-5}))


def test_a_cable_that_is_never_loose_is_another_law_as_its_author_says(page):
    """Without an entry in a table of ours; where he says nothing it keeps its name."""
    law = installed().laws["slack_cable"]
    fitter, _ = axis_fitter(n=100).described(AXIS)
    begun = Structure(AXIS).with_cause(Hypothesis("slack_cable", "stage:axis", "axis"), {"stiffness": 2e4, "gap": 0.0})
    fit = fitter.fit(begun, steps=0)
    assert another_law(fit, 0) == "its gap is at a bound of 0 um, where it is another stiffness to one side"
    law.at_bounds = {}
    assert another_law(fit, 0) is None


def stage(folder: Path, package: str = "") -> Path:
    file = folder / "stage.toml"
    file.write_text(AXIS_FILE.read_text() + ON_AXIS.format(package=package))
    return file


def test_a_file_with_it_is_read_and_one_that_names_another_package_is_refused(page):
    device = load_device(stage(page, 'package = "my-stage"'))
    assert device.effect[0].placed() == {"kind": "slack_cable", "package": "my-stage", "at": "axis"}
    rests = simulate(build_model(device), np.full((2000, 1), 1.5), 1e-3).signals["reading"][-1, 0]
    assert rests == pytest.approx((10 * 1.5 + 2e4 * 3e-5) / (2e5 + 2e4), rel=1e-6)  # (force + k gap) / (K + k)
    with pytest.raises(InputError, match="slack_cable is here a law of the package my-stage"):
        load_device(stage(page, 'package = "your-stage"'))


@pytest.mark.parametrize(
    ("package", "told"), [('package = "my-stage"', "pip install my-stage"), ("", "once that package")]
)
def test_a_file_that_needs_it_says_what_to_install_where_it_is_absent(package, told, tmp_path):
    with pytest.raises(InputError, match=told):
        load_device(stage(tmp_path, package))


@pytest.mark.long
def test_a_path_is_solved_and_its_c_computes_it(page, tmp_path):
    file = stage(tmp_path)
    made = ctrlgen("new", "scenario", tmp_path / "line", "--device", file)
    assert made.returncode == 0, made.stderr
    done = ctrlgen("run", tmp_path / "line", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "- 3e-05f;" in (tmp_path / "out" / "c" / "flexure_axis_online_f32.c").read_text()  # the gap


GOOD = of_the_page()["my_stage/laws.py"]
WRONG = {
    "nothing": ('Param("stiffness", "N/travel"', 'Param("stiffness", ""', "stiffness has no unit"),
    "unknown": ('"N/travel"', '"N/furlongs_of_mine"', "is not a unit I know"),
    "import": ("import casadi as ca", "import no_such_module", "ModuleNotFoundError"),
    "exit": ("import casadi as ca", "import sys; sys.exit()", "SystemExit"),
    "clash": ("class SlackCable", "class Creep", "has a law of the name creep"),
    "acts": ("return -p.stiffness *", "return -1.0 *", "must be zero where stiffness is at its off value"),
    "evaluate": ("s.displacement", "s.displacements_of_all", "cannot be evaluated: AttributeError"),
    "vector": ("s.displacement -", "s.displacements -", "must be one number"),
    "bounds": ("(0.0, 20.0)", "(20.0, 0.0)", "bounds 20 ... 0"),
    "reserved": ('"gap"', '"package"', "cannot name a number"),
    "family": ("Family.ELASTIC", '"elastic"', "family must be a Family"),
    "shape": ('at_bounds = {"gap"', 'at_bounds = {"gape"', "at_bounds states something of gape"),
    "start": ('parameters={"gap"', 'parameters={"gape"', "prior states something of gape"),
    "ends": (
        'ShapeBounds(low="another stiffness to one side")',
        '"a spring"',
        "gap must be stated as a ShapeBounds",
    ),
    "prior": ("    prior = ", '    prior = "rare"\n    other = ', "prior must be a"),
    "needs": ("    place =", "    requires = frozenset({'steam'})\n    place =", "requires steam"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_law_that_cannot_be_used_is_left_out_with_its_package_and_the_reason(case, tmp_path, monkeypatch):
    before, (text, wrong, why) = dict(Effect.library), WRONG[case]
    assert text in GOOD
    install(
        tmp_path, "my-stage", {"slack_cable": f"law_{case}:SlackCable"}, **{f"law_{case}": GOOD.replace(text, wrong)}
    )
    found, (left_out,) = loaded(tmp_path, monkeypatch)
    assert not found and Effect.library == before
    assert left_out.package == "my-stage" and why in str(left_out)


def test_of_two_laws_of_one_name_neither_is_taken(tmp_path, monkeypatch):
    for name in ("one", "two"):
        install(tmp_path, name, {"slack_cable": f"law_of_{name}:SlackCable"}, **{f"law_of_{name}": GOOD})
    found, left_out = loaded(tmp_path, monkeypatch)
    assert not found and {each.package for each in left_out} == {"one", "two"}
    assert all("one and two both bring" in each.why for each in left_out)


@pytest.mark.long
def test_a_command_warns_once_of_what_is_left_out_and_goes_on(tmp_path, monkeypatch):
    install(tmp_path, "my-stage", {"slack_cable": "gone:SlackCable"})
    monkeypatch.syspath_prepend(str(tmp_path))
    done = ctrlgen("check", AXIS_FILE)
    assert done.returncode == 0 and done.stderr.count("the law slack_cable of the package my-stage is left out") == 1
    with pytest.warns(match="left out"), pytest.raises(InputError, match="gone:SlackCable cannot be loaded"):
        load_device(stage(tmp_path))


def test_a_kept_result_is_made_again_where_the_code_of_a_law_changed(page):
    before = installed().digest
    (page / "my_stage" / "laws.py").write_text(GOOD + "\n# mended\n")
    installed.cache_clear()
    version.code_hash.cache_clear()
    assert before and installed().digest != before
