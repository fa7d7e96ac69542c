"""The direction of the data flow: which package may import which, and no circle among modules."""

from __future__ import annotations

import ast
import re
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

from conftest import ROOT, SCENARIOS

import ctrlgen

PACKAGE = ROOT / "ctrlgen"
DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef
FOUNDATION = "core numerics reporting"
DEVICES = f"{FOUNDATION} physics effects devices"
MODEL = f"{DEVICES} model"
TRAJECTORY = f"{MODEL} controller trajectory.inverse trajectory"
ESTIMATION = f"{MODEL} recordings estimation"
DIAGNOSIS = f"{ESTIMATION} diagnosis.settings"
C = f"{TRAJECTORY} firmware.c firmware.player firmware.online firmware"
# Folder -> folders below it; every module may import its own folder and the program's version
MAY_IMPORT = {
    "core": "",
    "numerics": "core",
    "reporting": "core",
    "physics": "core numerics",
    "effects": "core physics",
    "devices": f"{FOUNDATION} physics effects",
    "devices.mechanism": DEVICES,
    "devices.user": DEVICES,
    "model": DEVICES,
    "controller": MODEL,
    "recordings.formats": DEVICES,
    "recordings": f"{MODEL} recordings.formats",
    "recordings.look": f"{MODEL} recordings recordings.formats",
    "estimation": f"{MODEL} recordings",
    "trajectory.inverse": f"{MODEL} controller",
    "trajectory": f"{MODEL} controller trajectory.inverse",
    "budget": TRAJECTORY,
    "path_timing": f"{TRAJECTORY} budget",
    "learning": f"{TRAJECTORY} recordings budget",
    "firmware.c": FOUNDATION,
    "firmware.player": f"{TRAJECTORY} firmware.c",
    "firmware.online": f"{TRAJECTORY} firmware.c firmware.player",
    "firmware": f"{TRAJECTORY} firmware.c firmware.player firmware.online",
    "firmware.fmi": C,
    "calibration": f"{C} estimation recordings budget",
    "verification": f"{C} budget",
    "diagnosis.settings": "",
    "diagnosis.shares": DIAGNOSIS,
    "diagnosis.selection": f"{DIAGNOSIS} diagnosis.shares",
    "diagnosis.evidence": f"{DIAGNOSIS} diagnosis.shares diagnosis.selection",
    "diagnosis.report": f"{DIAGNOSIS} diagnosis.shares diagnosis.selection diagnosis.evidence",
    "diagnosis": f"{DIAGNOSIS} diagnosis.shares diagnosis.selection diagnosis.evidence diagnosis.report",
    "app": f"{C} firmware.fmi devices.mechanism devices.user budget path_timing learning verification calibration recordings estimation "
    "diagnosis diagnosis.shares diagnosis.selection diagnosis.evidence diagnosis.report",
}
MAY_IMPORT["app"] += " recordings.look recordings.formats"
MAY_IMPORT["app.new_files"] = f"{C} devices model trajectory"
MAY_IMPORT["app.viewer"] = FOUNDATION
MAY_IMPORT["app.commands"] = f"app app.new_files app.viewer {MAY_IMPORT['app']}"
MODULES = sorted(PACKAGE.rglob("*.py"))


def name_of(path) -> str:
    """'physics.screw' for ctrlgen/physics/screw.py; '' is the package itself."""
    parts = list(path.relative_to(PACKAGE).with_suffix("").parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {name_of(path): path for path in MODULES}


def folder_of(name: str) -> str:
    """'diagnosis.report' for 'diagnosis.report.figures', '' for '__main__'."""
    return ".".join(NAMES[name].parent.relative_to(PACKAGE).parts)


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """What a file imports, says and documents."""
    kinds = ast.Import | ast.ImportFrom | ast.Constant | DOCUMENTED
    return tuple(node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, kinds))


def imported_packages(path: Path) -> set[str]:
    """The first words of all that a file imports."""
    names = [a.name for node in nodes_of(path) if isinstance(node, ast.Import) for a in node.names]
    names += [node.module or "" for node in nodes_of(path) if isinstance(node, ast.ImportFrom)]
    return {name.split(".")[0] for name in names}


@cache
def our_imports(path: Path) -> frozenset[str]:
    """Modules of ours that a file imports, those that it imports late or for type checkers included."""
    names = set()
    for node in nodes_of(path):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "ctrlgen":
            module = node.module.removeprefix("ctrlgen").removeprefix(".")
            inside = {f"{module}.{a.name}".removeprefix(".") for a in node.names}
            names |= {name for name in inside if name in NAMES} or {module}
        elif isinstance(node, ast.Import):
            names |= {a.name.removeprefix("ctrlgen.") for a in node.names if a.name.startswith("ctrlgen.")}
    return frozenset(names)


def test_a_folder_imports_only_what_it_may():
    for path in MODULES:
        if path.parent == PACKAGE:
            continue
        own = folder_of(name_of(path))
        allowed = {own, *MAY_IMPORT[own].split()}
        for imported in our_imports(path) - {"version", ""}:
            assert folder_of(imported) in allowed, f"{name_of(path)} imports {imported}"


def test_no_modules_import_each_other_in_a_circle():
    graph = {name: {m for m in our_imports(path) if m != name} for name, path in NAMES.items() if name}
    # That package finds its laws
    graph = {name: {m for m in found if m and m != "effects"} for name, found in graph.items()}
    TopologicalSorter(graph).prepare()  # raises CycleError


def test_folders_do_not_import_each_other_in_a_circle():
    TopologicalSorter({name: allowed.split() for name, allowed in MAY_IMPORT.items()}).prepare()


def test_no_two_files_share_a_name():
    stems = [path.stem for path in MODULES if path.stem not in {"__init__", "__main__"}]
    assert {name for name in stems if stems.count(name) > 1} == set()


def test_paths_are_solved_through_the_one_door_that_knows_robust_limits():
    """`ctrlgen.budget.robust.solve`; what moves a path for it solves it without limits."""
    inner = {name_of(path) for path in MODULES if "trajectory.nominal" in our_imports(path)}
    assert inner == {"budget.robust", "budget.moved_path"}


def test_a_law_needs_the_extension_point_and_shared_helpers_and_nothing_else():
    laws = [p for p in MODULES if p.parent.name == "effects" and not p.stem.startswith("_")]
    assert len(laws) > 50
    for path in laws:
        imported = our_imports(path)
        assert "effects" in imported, path.stem
        assert all(name == "effects" or name.startswith("effects._") for name in imported), path.stem


SHOWN = {"app.commands.app": {"circle20"}}  # the example of --help
WORDS = {"raster", "spiral", "unreachable"}  # names of scenarios that are words: kinds of path, an exception


def test_no_module_knows_a_scenario_or_a_recording_by_name():
    folders = {
        p.parent.name for kind in ("scenario", "recording", "device", "run_a") for p in SCENARIOS.glob(f"*/{kind}.toml")
    }
    assert {"nist_hexapod", "emps", "rotary_axis", "friction_damper", "circle20"} <= folders
    for path in MODULES:
        # Examples of a command
        told = {ast.get_docstring(n, clean=False) for n in nodes_of(path) if isinstance(n, DOCUMENTED)}
        texts = {n.value for n in nodes_of(path) if isinstance(n, ast.Constant) and isinstance(n.value, str)} - told
        known = SHOWN.get(name_of(path), set()) | WORDS
        words = {word for text in texts for word in re.findall(r"\w+", text)}
        assert not words & (folders - known), name_of(path)


def test_no_module_reaches_what_makes_concealed_recordings():
    for path in MODULES:
        assert not imported_packages(path) & {"battery", "plants", "papers", "tests"}, name_of(path)


def test_what_makes_concealed_recordings_imports_nothing_of_ours():
    paths = sorted((ROOT / "battery").glob("*.py"))
    assert len(paths) > 20
    for path in paths:
        assert not our_imports(path), path.stem


def test_files_are_short_enough_to_be_one_noun():
    lengths = {name_of(path): len(path.read_text().splitlines()) for path in MODULES}
    assert {name: length for name, length in lengths.items() if length > 400} == {}


def test_the_independent_models_import_nothing_of_ctrlgen() -> None:
    paths = sorted((ROOT / "plants").glob("*.py"))
    assert len(paths) > 5
    for path in paths:
        assert "ctrlgen" not in imported_packages(path), path.name


def test_a_public_class_has_a_name_of_its_own():
    """What `ctrlgen` exports means one thing, wherever in the package it is met."""
    defined = [
        node.name for path in MODULES for node in ast.parse(path.read_text()).body if isinstance(node, ast.ClassDef)
    ]
    exported = [name for name in ctrlgen.__all__ if isinstance(getattr(ctrlgen, name), type)]
    assert len(exported) > 20 and {name: defined.count(name) for name in exported} == dict.fromkeys(exported, 1)


def test_nothing_is_called_equal_within_a_fixed_size():
    """Values are in SI units: numpy's default tolerance of 1e-8 calls two errors of nanometres equal. Each use states its own."""
    compares = {"np.allclose", "np.isclose", "np.testing.assert_allclose", "allclose", "isclose", "assert_allclose"}
    fixed = [
        f"{path.relative_to(ROOT)}:{call.lineno}"
        for path in MODULES
        for call in ast.walk(ast.parse(path.read_text()))
        if isinstance(call, ast.Call) and ast.unparse(call.func).replace("numpy", "np") in compares
        if "atol" not in {k.arg for k in call.keywords}
    ]
    assert not fixed
