"""The direction of the data flow: a module imports only what stands above it."""

from __future__ import annotations

import ast
import re

import pytest
from conftest import ROOT, SCENARIOS

PACKAGE = ROOT / "ctrlgen"
DOCUMENTED = ast.Module | ast.ClassDef | ast.FunctionDef
LAYERS = [
    "_version errors units",
    "executor", "files", "reference_models reference_models.hinge_fem", "measuring_chain",
    "physics.screw", "physics.flexure", "physics.circular_hinge", "physics.circular_hinge_table",
    "physics.thermal_actuator", "physics.xy_stage physics.hexapod physics.meso_hexapod",
    "physics.piezo_stack", "physics.rrr_stage",
    "effect lattice turning play", "event frame", "effects",
    "devices.section", "devices.ports", "devices.sensor", "devices.base", "devices.hinge",
    "devices.mems_hexapod devices.rrr_stage devices.meso_hexapod devices.axis devices.servo devices.tested_axis devices.user", "devices",
    "calibration pose_errors",
    "chain", "model", "marking conditioning recording_formats recording_file", "gate", "recording",
    "exponential", "motion", "simulation inverse", "readings intervals", "controller linearisation",
    "paths", "scenario", "workspace", "programme", "shortfall", "solution",
    "firmware firmware.cprint firmware.templates firmware.misra firmware.deviations firmware.spline firmware.fourier",
    "firmware.compression firmware.elementary",
    "firmware.online firmware.player firmware.plant firmware.fmi_calls", "firmware.vectors firmware.package", "firmware.folder",
    "verification verification.toolchains verification.reference verification.check", "verification.host verification.cores",
    "verification.emulation", "firmware.fmu",
    "verification.tracking", "verification.comparison verification.rules verification.hostile verification.in_loop verification.qemu",
    "measures", "figures", "bode report", "build_record build_figures", "build_page",
    "reproduce reproduce.row reproduce.rounding reproduce.s0_data", "reproduce.hinge_errors reproduce.s3_tables",
    "reproduce.s3_lengths",
    "reproduce.s0 reproduce.s0_figures reproduce.s1 reproduce.s2 reproduce.s2_figures reproduce.s3 reproduce.s3_hinges",
    "reproduce.all",
    "diagnosis.plain diagnosis.mapped diagnosis.equations", "diagnosis.carried",
    "diagnosis.response diagnosis.hypotheses diagnosis.probe diagnosis.noise diagnosis.pitches diagnosis.journal diagnosis.descent "
    "diagnosis.quiet diagnosis.spikes",
    "diagnosis.structure", "diagnosis.fit", "diagnosis.learnt",
    "diagnosis.laws diagnosis.scatter", "diagnosis.spread diagnosis.profile", "diagnosis.slopes", "diagnosis.together",
    "diagnosis.screen diagnosis.adequacy diagnosis.resolved diagnosis.forecast", "diagnosis.trial", "diagnosis.weighing",
    "diagnosis.search",
    "diagnosis.diagnosis", "diagnosis.read_off", "diagnosis.dead",
    "diagnosis.along diagnosis.lines", "diagnosis.where diagnosis.free diagnosis.memory diagnosis.drives",
    "diagnosis.empirical diagnosis.detectable diagnosis.experiment", "diagnosis.unknown diagnosis.proposal",
    "diagnosis.evidence", "diagnosis", "diagnosis.words diagnosis.record",
    "diagnosis.writeback diagnosis.picture_maps diagnosis.picture_sure", "diagnosis.pictures", "diagnosis.page",
    "diagnosis.bootstrap", "diagnosis.job", "batch",
    "job", "terminal", "commands commands.app", "commands.controllers commands.devices commands.recordings", "cli", "", "__main__",
]  # fmt: skip
RANK = {name: rank for rank, row in enumerate(LAYERS) for name in row.split(" ")}
MODULES = sorted(PACKAGE.rglob("*.py"))


def name_of(path) -> str:
    """'physics.screw' for ctrlgen/physics/screw.py; effects count as one layer; '' is the package itself."""
    parts = list(path.relative_to(PACKAGE).with_suffix("").parts)
    if parts[-1] == "__init__":
        parts.pop()
    return "effects" if parts[:1] == ["effects"] else ".".join(parts)


def our_imports(path) -> set[str]:
    """Modules of ours that a file imports at its top level; a type-checking block does not run."""
    names = set()
    for node in ast.parse(path.read_text()).body:  # not what only type checkers see
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "ctrlgen":
            module = node.module.removeprefix("ctrlgen").removeprefix(".")
            inside = {f"{module}.{a.name}".removeprefix(".") for a in node.names}
            names |= {name for name in inside if name in RANK} or {module}
        elif isinstance(node, ast.Import):
            names |= {a.name.removeprefix("ctrlgen.") for a in node.names if a.name.startswith("ctrlgen.")}
    return names


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_imports_point_upwards(path):
    name = name_of(path)
    for imported in our_imports(path):
        imported = "effects" if imported.startswith("effects") else imported
        if imported == "" and name == "__main__":
            continue
        assert RANK[imported] <= RANK[name], f"{name} imports {imported}, which stands below it in the layout"


@pytest.mark.parametrize("path", [p for p in MODULES if "physics" in p.parts], ids=name_of)
def test_the_physics_knows_no_device_file(path):
    assert all(imported.startswith("physics") for imported in our_imports(path))


@pytest.mark.parametrize(
    "path", [p for p in MODULES if p.parent.name == "effects" and p.stem != "__init__"], ids=lambda p: p.stem
)
def test_an_effect_needs_the_extension_point_and_nothing_else(path):
    assert our_imports(path) - {"event", "frame", "lattice", "play", "turning"} == {
        "effect"
    }  # what several laws have in common


SHOWN = {  # the papers' figures are drawn from these, and their numbers compared
    "reproduce.all": {"circle20", "xy_stage_force"},
    "reproduce.s0_data": {"nist_hexapod"},
    "commands.app": {"circle20"},  # the example of --help
}
WORDS = {"raster", "spiral", "unreachable"}  # names of scenarios that are words: kinds of path, an exception


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_no_module_knows_a_scenario_or_a_recording_by_name(path):
    tree = ast.parse(path.read_text())
    told = {
        ast.get_docstring(n, clean=False) for n in ast.walk(tree) if isinstance(n, DOCUMENTED)
    }  # examples of a command
    texts = {n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)} - told
    folders = {
        p.parent.name for kind in ("scenario", "recording", "device", "run_a") for p in SCENARIOS.glob(f"*/{kind}.toml")
    }
    assert {"nist_hexapod", "emps", "rotary_axis", "friction_damper", "circle20"} <= folders
    known = SHOWN.get(name_of(path), set()) | WORDS
    words = {word for text in texts for word in re.findall(r"\w+", text)}
    assert not words & (folders - known)


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_no_module_reaches_what_makes_concealed_recordings(path):
    for node in ast.walk(ast.parse(path.read_text())):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        assert not {name.split(".")[0] for name in names} & {"battery", "plants", "tests"}, path


@pytest.mark.parametrize("path", sorted((ROOT / "battery").glob("*.py")), ids=lambda p: p.stem)
def test_what_makes_concealed_recordings_imports_nothing_of_ours(path):
    assert not our_imports(path)


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_files_are_short_enough_to_be_one_noun(path):
    assert len(path.read_text().splitlines()) <= 400


def test_the_independent_models_import_nothing_of_ctrlgen() -> None:
    paths = sorted((ROOT / "plants").glob("*.py"))
    assert len(paths) > 5
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            assert not any(name.split(".")[0] == "ctrlgen" for name in names), path.name
