"""The generated folder as a package: it links beside others from C and C++, tests itself, says what it is and was made from."""

from __future__ import annotations

import json
import re
import shutil
import subprocess

import pytest
from conftest import SCENARIOS
from package_programs import STRICT, everything, run

from ctrlgen import InputError, build_model, generate, load_scenario
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder
from ctrlgen.firmware.package import verify_package
from ctrlgen.trajectory.solution_plots import draw_solution

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def unsolved(tmp_path_factory) -> CFolder:
    scenario = load_scenario(SCENARIOS / "spiral")
    return generate(scenario, build_model(scenario.device), tmp_path_factory.mktemp("spiral") / "spiral")


def test_all_controllers_of_two_scenarios_link_into_one_program_and_pass_their_tests(
    packages, objects, compiler, tmp_path
):
    (tmp_path / "main.c").write_text(everything(packages))
    include = [f"-I{c.path}" for c in packages.values()]
    linked = [o for made in objects.values() for o in made]
    run(compiler, "-std=c99", *STRICT, *include, tmp_path / "main.c", *linked, "-o", tmp_path / "main")
    run(tmp_path / "main")


def test_the_same_from_cpp(packages, objects, cpp, tmp_path):
    (tmp_path / "main.cpp").write_text(everything(packages))
    include = [f"-I{c.path}" for c in packages.values()]
    linked = [o for made in objects.values() for o in made]
    run(cpp, "-std=c++17", *STRICT, *include, tmp_path / "main.cpp", *linked, "-o", tmp_path / "main")
    run(tmp_path / "main")


def test_every_external_symbol_begins_with_the_name_of_scenario_or_device(packages, objects):
    if not shutil.which("nm"):
        pytest.skip("nm is missing: the symbols of the objects were not read; apt-get install binutils")
    seen: list[str] = []
    for name, made in objects.items():
        for path in made:
            defined = [
                line.split()[-1] for line in run("nm", "-g", "--defined-only", path).splitlines() if line.strip()
            ]
            assert defined and all(symbol.startswith(f"{path.stem}_") or symbol == path.stem for symbol in defined), (
                path
            )
            assert path.stem.startswith((f"{name}_", f"{packages[name].online[Real.FLOAT].rpartition('_')[0]}_"))
            seen += defined
    assert len(seen) == len(set(seen))


def test_every_name_a_header_defines_begins_with_the_name_of_its_file(packages):
    for c in packages.values():
        for header in c.path.glob("*.h"):
            macros = re.findall(r"^#define (\w+)", header.read_text(), re.MULTILINE)
            assert macros and all(macro.startswith(f"{header.stem.upper()}_") for macro in macros), header.name


@pytest.mark.parametrize("standard", ["c99", "c11", "c++11", "c++17"])
def test_each_header_compiles_alone(packages, compiler, cpp, tmp_path, standard):
    main = tmp_path / ("alone.cpp" if "+" in standard else "alone.c")
    for header in sorted(packages["circle20"].path.glob("*.h")):
        main.write_text(f'#include "{header}"\n#include "{header}"\n')
        words = (cpp if "+" in standard else compiler, f"-std={standard}", *STRICT, "-fsyntax-only", main)
        run(*words)


def test_the_readmes_example_compiles_and_runs(packages, unsolved, compiler, tmp_path):
    for c in (*packages.values(), unsolved):
        (example,) = re.findall(r"```c\n(.*?)```", (c.path / "README.md").read_text(), re.DOTALL)
        assert len(example.splitlines()) <= 25
        (tmp_path / "example.c").write_text(example)
        source = c.path / f"{c.online[Real.FLOAT]}.c"
        words = (compiler, "-std=c99", *STRICT, f"-I{c.path}", tmp_path / "example.c", source)
        run(*words, "-o", tmp_path / "example")
        drives = 3 if c.name == "mirror_spiral" else 6
        assert len(re.findall(r"drive\[\d\] = [\d.e-]+ [WV]", run(tmp_path / "example"))) == drives


def test_the_readme_states_units_limits_statuses_costs_and_provenance(packages, circle):
    c = packages["circle20"]
    text = (c.path / "README.md").read_text()
    for words in (
        "3: delta_x [m]",
        "0: 1X [W]",
        "temperature_3Y [K]",
        "wire flexure stress <= 550 MPa",
        "_DRIVE` 8",
        "called every 0.001 s (1000 Hz)",
        f"{c.operations} arithmetic operations",
        f"{c.worst_operations} at most",
        circle.scenario.digest["device"],
        "Mech. Mach. Theory",
        "calls on one state must not",
    ):
        assert words in text, words
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", text)
    assert len(pictures) == 5 and all((c.path / picture).read_text().startswith("<svg") for picture in pictures)


def test_the_readme_of_an_unsolved_scenario_says_what_is_absent(unsolved):
    text = (unsolved.path / "README.md").read_text()
    assert "has no player" in text and "has no figures" in text and "_player_" not in text
    assert not list(unsolved.path.glob("*player*")) and not (unsolved.path / "figures").exists()


def test_the_readmes_sizes_are_those_of_the_compiled_c(packages, objects, compiler, tmp_path):
    c = packages["circle20"]
    text = (c.path / "README.md").read_text()
    stated = {
        m[0]: (int(m[1]), int(m[2])) for m in re.findall(r"^\| ([\w' ]+) \| (\d+) B \| (\d+) B \|", text, re.MULTILINE)
    }
    types = [f"{c.online[real]}_{kind}" for kind in ("state", "output") for real in (Real.FLOAT, Real.DOUBLE)]
    prints = "".join(f'    printf("%u\\n", (unsigned)sizeof({t}));\n' for t in types)
    headers = "".join(f'#include "{c.online[real]}.h"\n' for real in Real)
    (tmp_path / "m.c").write_text(f"{headers}#include <stdio.h>\nint main(void)\n{{\n{prints}    return 0;\n}}\n")
    run(compiler, f"-I{c.path}", tmp_path / "m.c", "-o", tmp_path / "m")
    assert list(map(int, run(tmp_path / "m").split())) == [*stated["state"], *stated["output"]]
    if not shutil.which("nm"):
        pytest.skip("nm is missing: the sizes of the tables were not read; apt-get install binutils")
    for piece, what in (("player", "player's table"), ("vectors", "vectors")):
        for real, size in zip((Real.FLOAT, Real.DOUBLE), stated[what], strict=True):
            (path,) = (o for o in objects["circle20"] if o.stem == getattr(c, piece)[real])
            rows = [line.split() for line in run("nm", "-S", path).splitlines()]
            constants = {row[3]: int(row[1], 16) for row in rows if len(row) == 4 and row[2] in "rR"}
            assert sum(constants.values()) == size, (piece, real)


def test_the_copied_inputs_make_the_same_c_again(packages, tmp_path):
    c = packages["mirror_spiral"]
    scenario = load_scenario(c.path / "device" / "mirror_spiral")
    again = generate(scenario, build_model(scenario.device), tmp_path)
    for real in Real:
        for suffix in ("h", "c"):
            name = f"{c.online[real]}.{suffix}"
            assert (again.path / name).read_bytes() == (c.path / name).read_bytes()


def test_poses_from_a_file_and_absolute_paths_are_copied_too(tmp_path):
    home = tmp_path / "bench" / "walk"
    home.mkdir(parents=True)
    device = SCENARIOS.resolve() / "devices" / "mems_hexapod.toml"
    (home / "poses.csv").write_text("delta_z [um]\n20\n21\n")
    (home / "scenario.toml").write_text(
        f'title = "walk"\ndevice = "{device}"\nsample_rate = "1 kHz"\n[path]\nkind = "poses"\nfile = "poses.csv"\n'
    )
    scenario = load_scenario(home)
    c = generate(scenario, build_model(scenario.device), tmp_path / "c")
    found = {p.relative_to(c.path / "device").as_posix() for p in (c.path / "device").rglob("*") if p.is_file()}
    assert found == {"walk/scenario.toml", "walk/poses.csv", "mems_hexapod.toml"}


def test_the_manifest_tells_a_spoiled_file(packages, tmp_path):
    folder = tmp_path / "circle20"
    shutil.copytree(packages["circle20"].path, folder)
    assert verify_package(folder) == ()
    manifest = json.loads((folder / "manifest.json").read_text())
    files = {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}
    assert files == {*manifest["files"], "manifest.json"} and "belongs to the user" in manifest["licence"]
    (folder / "build").mkdir()
    (folder / "build" / "a.c").write_text("")  # a build may stand there
    spoiled = folder / "mems_hexapod_online_f32.c"
    spoiled.write_text(spoiled.read_text().replace("5.5e-05f", "5.6e-05f", 1))
    (folder / "device" / "circle20" / "scenario.toml").unlink()
    (folder / "mine.c").write_text("")
    assert {(f.where, f.what.split(";")[0]) for f in verify_package(folder)} == {
        ("mems_hexapod_online_f32.c", "was changed since it was generated"),
        ("device/circle20/scenario.toml", "is missing"),
        ("mine.c", "was added"),
    }
    (folder / "manifest.json").write_text("{}")
    with pytest.raises(InputError, match="no manifest of ctrlgen"):
        verify_package(folder)


def test_the_same_input_gives_the_same_bytes_of_everything(packages, circle, tmp_path):
    again = generate(circle.scenario, circle.model, tmp_path, circle, draw_solution(circle))
    first = packages["circle20"].path
    names = sorted(p.relative_to(first) for p in first.rglob("*") if p.is_file())
    assert names == sorted(p.relative_to(again.path) for p in again.path.rglob("*") if p.is_file())
    for name in names:
        assert (first / name).read_bytes() == (again.path / name).read_bytes(), name


@pytest.mark.parametrize(
    ("piece", "pattern", "replacement"),
    [
        ("online", r"5\.5e-05f", "5.6e-05f"),  # the stroke, wherever it stands
        ("online", r"uint32_t status = 0U;", "uint32_t status = 64U;"),
        # NaN is neither above nor below a limit
        (
            "online",
            r"\(\(\w*bits_of\(&target\[(\d)\]\) & 0x7FFFFFFFU\) <= \w+\)",
            r"(!((target[\1] > 60.0f) || (target[\1] < -60.0f)))",
        ),
        ("online", r"drive\[i\] = (\w*U_SAFE)\[i\];", r"drive[i] = \1[i] + 1.0f;"),
        ("player", r"then >= DURATION", "(time < 0.0f) || (time >= (1e9f + (float)DURATION + (0.0f * (float)then)))"),
        ("player", r"(CONTROL\[\d+\]\[6\] = \{\n        \{ 0\.0\d)(\d)", r"\g<1>0"),
    ],
)
def test_the_selftest_finds_a_wrong_constant_and_a_missing_check(
    packages, compiler, tmp_path, piece, pattern, replacement
):
    c = packages["circle20"]
    folder = tmp_path / "c"
    shutil.copytree(c.path, folder)
    spoiled = folder / f"{getattr(c, piece)[Real.FLOAT]}.c"
    text, count = re.subn(pattern, replacement, spoiled.read_text())
    assert count and text != spoiled.read_text()
    spoiled.write_text(text)
    sources = [folder / source.name for source in c.sources(Real.FLOAT)]
    runner = folder / "test" / c.runner(Real.FLOAT).name
    run(compiler, "-std=c99", *STRICT, f"-I{folder}", runner, *sources, "-o", tmp_path / "t")
    done = subprocess.run([tmp_path / "t"], capture_output=True, text=True)
    assert done.returncode == 1 and "the first that disagrees: vector" in done.stdout
