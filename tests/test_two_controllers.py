"""Two controllers in one firmware: of one device at two rates under two names, and what is said where they have one name."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from conftest import SCENARIOS
from mechanism_files import loaded
from package_programs import run
from two_masses import two_masses

from ctrlgen import build_model, generate, load_scenario, solve
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.fmi.plant import plant_of, write_plant
from ctrlgen.firmware.folder import CFolder

USE = """
#include "{online}.h"
uint32_t {name}(void);
uint32_t {name}(void)
{{
    static {online}_state state;
    {online}_output out;
    const float target[{online_upper}_TARGET_SIZE] = {{ 1e-5f }};
    {online}_init(&state);
    return {online}_step(&state, target, &out);
}}
"""
MAIN = """
#include <stdint.h>
uint32_t slow(void);
uint32_t fast(void);
int main(void) { return (int)(slow() | fast()); }
"""


def folder(scratch: Path, name: str, rate: str, controller: str = "", played: bool = False) -> CFolder:
    """The C of the flexure axis at a rate: its controller with a name of its own where one is given, its player where that is asked."""
    text = (SCENARIOS / "flexure_axis_line" / "scenario.toml").read_text()
    text = text.replace('"20 kHz"', f'"{rate}"').replace("../devices", str(SCENARIOS / "devices"))
    home = scratch / name
    home.mkdir(parents=True)
    own = f'controller = "{controller}"\n' if controller else ""
    checksum = "checksum = true\n" if played else ""
    (home / "scenario.toml").write_text(own + checksum + text)
    scenario = load_scenario(home / "scenario.toml")
    model = build_model(scenario.device)
    return generate(scenario, model, scratch / f"{name}_c", solve(scenario, model) if played else None)


def archive(compiler: str, scratch: Path, name: str, c: CFolder) -> Path:
    """A static library of the controller in float."""
    run(compiler, "-std=c99", "-c", c.path / f"{c.online[Real.FLOAT]}.c", "-o", scratch / f"{name}.o")
    run("ar", "rcs", scratch / f"lib{name}.a", scratch / f"{name}.o")
    return scratch / f"lib{name}.a"


def used(compiler: str, scratch: Path, name: str, c: CFolder) -> Path:
    """An object of a firmware that calls the controller by its header."""
    online = c.online[Real.FLOAT]
    (scratch / f"{name}_use.c").write_text(USE.format(name=name, online=online, online_upper=online.upper()))
    run(compiler, "-std=c99", f"-I{c.path}", "-c", scratch / f"{name}_use.c", "-o", scratch / f"{name}_use.o")
    return scratch / f"{name}_use.o"


def linked(compiler: str, scratch: Path, *words: object) -> subprocess.CompletedProcess[str]:
    (scratch / "main.c").write_text(MAIN)
    command = [compiler, scratch / "main.c", *words, "-o", scratch / "firmware"]
    return subprocess.run(list(map(str, command)), capture_output=True, text=True)


@pytest.fixture(scope="module")
def built(compiler, tmp_path_factory):
    """(objects that use them, libraries) of the slow and the fast controller, which have one name, and of the slow one under another."""
    scratch = tmp_path_factory.mktemp("two")
    folders = {
        "slow": folder(scratch, "slow", "10 kHz"),
        "fast": folder(scratch, "fast", "20 kHz"),
        "named": folder(scratch, "named", "10 kHz", "slow_axis"),
    }
    libraries = {name: archive(compiler, scratch, name, c) for name, c in folders.items()}
    return folders, libraries, scratch


def test_two_rates_under_two_names_are_one_firmware_also_from_whole_archives(built, compiler):
    folders, libraries, scratch = built
    objects = used(compiler, scratch, "slow", folders["named"]), used(compiler, scratch, "fast", folders["fast"])
    for words in ([], ["-Wl,--whole-archive"]):
        ends = ["-Wl,--no-whole-archive"] if words else []
        done = linked(compiler, scratch, *objects, *words, libraries["named"], libraries["fast"], *ends)
        assert done.returncode == 0, done.stderr
        assert subprocess.run([scratch / "firmware"]).returncode == 0


def test_two_rates_under_one_name_do_not_link(built, compiler):
    folders, libraries, scratch = built
    objects = used(compiler, scratch, "slow", folders["slow"]), used(compiler, scratch, "fast", folders["fast"])
    both = linked(compiler, scratch, *objects, libraries["slow"], libraries["fast"])
    assert both.returncode != 0 and "multiple definition of `flexure_axis_online_f32_step'" in both.stderr
    one = linked(compiler, scratch, *objects, libraries["slow"])
    assert one.returncode != 0 and "flexure_axis_online_f32_init_20000hz_" in one.stderr


def test_a_state_of_another_build_is_lost(built, compiler):
    """Of two names, through a pointer that says nothing."""
    folders, libraries, scratch = built
    fast, slow = folders["fast"].online[Real.FLOAT], folders["named"].online[Real.FLOAT]
    (scratch / "mixed.c").write_text(
        f'#include "{fast}.h"\n#include "{slow}.h"\nint main(void)\n{{\n    static {fast}_state state;\n    {slow}_output out;\n'
        f"    const float target[{slow.upper()}_TARGET_SIZE] = {{ 0.0f }};\n    {fast}_init(&state);\n"
        f"    return {slow}_step(({slow}_state *)(void *)&state, target, &out) == {slow.upper()}_LOST ? 0 : 1;\n}}\n"
    )
    include = [f"-I{folders[name].path}" for name in ("fast", "named")]
    run(compiler, *include, scratch / "mixed.c", libraries["fast"], libraries["named"], "-o", scratch / "mixed")
    run(scratch / "mixed")


@pytest.mark.long
def test_cmake_takes_two_names_and_refuses_two_controllers_of_one(built, tmp_path):
    if not shutil.which("cmake"):
        pytest.skip("cmake is missing: the projects were not configured; apt-get install cmake")
    folders, _, _ = built

    def configured(*names: str) -> subprocess.CompletedProcess[str]:
        lines = "".join(f'add_subdirectory("{folders[name].path}" {name})\n' for name in names)
        home = tmp_path / "_".join(names)
        home.mkdir()
        (home / "CMakeLists.txt").write_text(f"cmake_minimum_required(VERSION 3.16)\nproject(two LANGUAGES C)\n{lines}")
        return subprocess.run(["cmake", "-S", home, "-B", home / "build"], capture_output=True, text=True)

    refused = configured("slow", "fast")
    assert refused.returncode != 0 and "two controllers of one name" in refused.stderr


@pytest.fixture(scope="module")
def namesakes(tmp_path_factory) -> list[CFolder]:
    """The C, with players and checksums, of two scenarios of one name that differ."""
    return [folder(tmp_path_factory.mktemp(rate[:2]), "line", rate, played=True) for rate in ("10 kHz", "20 kHz")]


@pytest.mark.parametrize("piece", ["online_f32", "online_f64", "player_f32", "player_f64"])
def test_one_source_that_reads_two_different_headers_of_one_name_is_told(namesakes, compiler, tmp_path, piece):
    """The guard of the first would hide the second, and its sizes and constants with it."""
    first, second = (next(c.path.glob(f"*_{piece}.h")) for c in namesakes)
    assert first.name == second.name

    def compiled(*headers: Path) -> subprocess.CompletedProcess[str]:
        source = tmp_path / "both.c"
        source.write_text("".join(f'#include "{header}"\n' for header in headers))
        return subprocess.run([compiler, "-std=c99", "-fsyntax-only", source], capture_output=True, text=True)

    assert compiled(first, first).returncode == 0
    for headers in ((first, second), (second, first)):
        told = compiled(*headers)
        assert told.returncode != 0 and f"two different headers are named {first.name}" in told.stderr


CALLS = {
    "_player_f32.c": "float drive[1]; return (int){name}_sample(3U, drive);",
    "_player_f64.c": "double drive[1]; return (int){name}_at(0.001, drive);",
    "_checked_f32.c": "static {name}_state state; {name}_init(&state); return 0;",
}


@pytest.mark.parametrize("ending", list(CALLS))
def test_a_program_that_is_linked_with_another_of_the_name_is_told(namesakes, compiler, tmp_path, ending):
    """Of two libraries that define one symbol a linker takes the first without a word: the drives were those of the other path."""
    libraries = []
    for k, c in enumerate(namesakes):
        objects = []
        for source in sorted(c.path.glob(f"*{ending.split('_')[-1]}")):
            objects.append(tmp_path / f"{source.stem}_{k}.o")
            run(compiler, "-std=c99", "-c", source, "-o", objects[-1])
        run("ar", "rcs", tmp_path / f"lib{k}.a", *objects)
        libraries.append(tmp_path / f"lib{k}.a")
    header = next(namesakes[0].path.glob(f"*{ending}")).with_suffix(".h")
    body = CALLS[ending].format(name=header.stem)
    (tmp_path / "main.c").write_text(f'#include "{header.name}"\nint main(void)\n{{\n    {body}\n}}\n')

    def made(*of: Path) -> subprocess.CompletedProcess[str]:
        words = [compiler, "-std=c99", f"-I{namesakes[0].path}", tmp_path / "main.c", *of, "-o", tmp_path / "firmware"]
        return subprocess.run(list(map(str, words)), capture_output=True, text=True)

    assert made(libraries[0]).returncode == 0
    alone = made(libraries[1])
    assert alone.returncode != 0 and f"undefined reference to `{header.stem}_" in alone.stderr


LINE = '[path]\nkind = "line"\nstart = { delta_x = "0 um" }\nend = { delta_x = "100 um" }\n'
# Of scenarios of one device: what changes its controller, and what does not.
KEYS = {
    "": "",
    "led": 'feedforward = "modes"\n',
    "slower": "",
    "falling": 'gravity = ["-0.5 m/s^2", "0 m/s^2", "0 m/s^2"]\n',
    "checked": "checksum = true\n",
}


def test_controllers_of_one_device_that_differ_are_different_builds(tmp_path):
    """And so are not linked one for the other: of a device whose modes were led the target has two numbers more, which a program that
    was compiled for the other controller did not give."""
    loaded(tmp_path, two_masses('modes_below = "200 Hz"\n'))
    builds: dict[str, set[str]] = {}
    for key, words in KEYS.items():
        rate = "1 kHz" if key == "slower" else "2 kHz"
        head = f'title = "t"\ndevice = "device.toml"\nsample_rate = "{rate}"\nduration = "0.05 s"\n'
        (tmp_path / "scenario.toml").write_text(head + words + LINE)
        scenario = load_scenario(tmp_path / "scenario.toml")
        made = generate(scenario, build_model(scenario.device), tmp_path / f"c_{key}")
        name = made.online[Real.FLOAT]
        text = (made.path / f"{name}.c").read_text() + (made.path / f"{name}.h").read_text()
        (build,) = set(re.findall(r"_BUILD \((\w+)\)", text))
        code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
        code = re.sub(rf"{build}|{build[2:].lower()}", "BUILD", code, flags=re.IGNORECASE)
        builds.setdefault(build, set()).add(code)
    assert all(len(codes) == 1 for codes in builds.values())
    assert len(builds) == 4


def test_a_plant_at_another_rate_is_not_linked_for_the_one_that_was_asked_for(compiler, tmp_path):
    text = (
        (SCENARIOS / "flexure_axis_line" / "scenario.toml")
        .read_text()
        .replace("../devices", str(SCENARIOS / "devices"))
    )
    for rate in ("10 kHz", "20 kHz"):
        (tmp_path / "scenario.toml").write_text(text.replace('"20 kHz"', f'"{rate}"'))
        scenario = load_scenario(tmp_path / "scenario.toml")
        (folder := tmp_path / rate[:2]).mkdir()
        name = write_plant(scenario, plant_of(scenario), Real.FLOAT, folder)
        run(compiler, "-std=c99", "-c", folder / f"{name}.c", "-o", folder / "plant.o")
    body = f"{name}_state state; const float drive[1] = {{ 0.0f }}; return (int){name}_init(&state, drive);"
    (tmp_path / "main.c").write_text(f'#include "{name}.h"\nint main(void)\n{{\n    {body}\n}}\n')
    words = [compiler, "-std=c99", f"-I{tmp_path / '10'}", tmp_path / "main.c", "-o", tmp_path / "main"]
    run(*words, tmp_path / "10" / "plant.o")
    other = subprocess.run([*map(str, words), tmp_path / "20" / "plant.o"], capture_output=True, text=True)
    assert other.returncode != 0 and f"undefined reference to `{name}_init_" in other.stderr
