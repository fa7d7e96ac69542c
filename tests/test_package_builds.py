"""The generated folder in the build systems it drops into: CMake, Zephyr, PlatformIO, Arduino."""

from __future__ import annotations

import json
import re
import subprocess

import pytest
from conftest import SCENARIOS
from package_programs import ARDUINO, STRICT, ZEPHYR, everything, run

from ctrlgen import __version__, build_model, generate, load_scenario
from ctrlgen.firmware.c.real import Real

pytestmark = pytest.mark.long

SEMANTIC = re.compile(r"(0|[1-9]\d*)\.(0|[1-9]\d*)\.(0|[1-9]\d*)(-[0-9A-Za-z.-]+)?(\+[0-9A-Za-z.-]+)?")


def test_cmake_builds_tests_and_installs(packages, cmake, cpp, tmp_path):
    """At top level with its own tests; installed, another project finds it."""
    c = packages["circle20"]
    run(cmake, "-S", c.path, "-B", tmp_path / "b", f"-DCMAKE_INSTALL_PREFIX={tmp_path / 'usr'}")
    run(cmake, "--build", tmp_path / "b")
    assert re.search(r"100% tests passed.* out of 2\b", run("ctest", "--test-dir", tmp_path / "b"))
    run(cmake, "--install", tmp_path / "b")
    (tmp_path / "p").mkdir()
    (tmp_path / "p" / "main.c").write_text(everything({"circle20": c}))
    (tmp_path / "p" / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.16)\nproject(p C)\nenable_testing()\nfind_package(circle20 REQUIRED)\n"
        "add_executable(p main.c)\ntarget_link_libraries(p PRIVATE ctrlgen::circle20_f32 ctrlgen::circle20_f64)\n"
        "add_test(NAME p COMMAND p)\n"
    )
    run(cmake, "-S", tmp_path / "p", "-B", tmp_path / "pb", f"-DCMAKE_PREFIX_PATH={tmp_path / 'usr'}")
    run(cmake, "--build", tmp_path / "pb")
    assert "100% tests passed" in run("ctest", "--test-dir", tmp_path / "pb")


def test_two_packages_are_subdirectories_of_one_cpp_project(packages, cmake, cpp, tmp_path):
    """Which gets the targets, and neither their tests nor their install rules."""
    (tmp_path / "main.cpp").write_text(everything(packages))
    adds = "".join(f"add_subdirectory({c.path} {name})\n" for name, c in packages.items())
    links = " ".join(f"ctrlgen::{name}_{real.suffix}" for name in packages for real in Real)
    (tmp_path / "CMakeLists.txt").write_text(
        f"cmake_minimum_required(VERSION 3.16)\nproject(firmware CXX)\nenable_testing()\n{adds}"
        f"add_executable(firmware main.cpp)\ntarget_link_libraries(firmware PRIVATE {links})\n"
        "add_test(NAME selftests COMMAND firmware)\n"
    )
    run(cmake, "-S", tmp_path, "-B", tmp_path / "b")
    run(cmake, "--build", tmp_path / "b")
    assert re.search(r"100% tests passed.* out of 1\b", run("ctest", "--test-dir", tmp_path / "b"))


@pytest.mark.parametrize("real", list(Real))
def test_the_zephyr_module_builds_with_stand_ins_for_zephyrs_functions(packages, cmake, tmp_path, real):
    """Zephyr itself is not run here: its four CMake functions that the module calls are."""
    text = ZEPHYR
    for name, c in packages.items():
        for option in ("", f"_{real.name}", "_SELFTEST"):
            text += f"set(CONFIG_{name.upper()}_CONTROLLER{option} y)\n"
        text += f"add_subdirectory({c.path}/zephyr {name})\n"
    libraries = [*packages, *(c.online[real] for c in packages.values())]
    text += f"add_executable(app main.c)\ntarget_link_libraries(app PRIVATE {' '.join(libraries)} m)\n"
    (tmp_path / "CMakeLists.txt").write_text(text)
    calls = " + ".join(f"{c.selftest[real]}(0)" for c in packages.values())
    includes = "".join(f"#include <{c.selftest[real]}.h>\n" for c in packages.values())
    (tmp_path / "main.c").write_text(f"{includes}int main(void) {{ return {calls}; }}\n")
    run(cmake, "-S", tmp_path, "-B", tmp_path / "b")
    run(cmake, "--build", tmp_path / "b")
    run(tmp_path / "b" / "app")


def test_zephyr_modules_of_one_controller_compile_it_once(packages, circle, cmake, tmp_path):
    """Two scenarios of one device, signal and rate, one with a checksum; and one of another rate under the same name, which is refused."""
    text = (SCENARIOS / "circle20" / "scenario.toml").read_text().replace("../devices", str(SCENARIOS / "devices"))
    folders = {}
    for name, rate, more in (("again", "1 kHz", "checksum = true\n"), ("slower", "500 Hz", "")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "scenario.toml").write_text(more + text.replace('"1 kHz"', f'"{rate}"'))
        scenario = load_scenario(tmp_path / name)
        folders[name] = generate(scenario, build_model(scenario.device), tmp_path / f"{name}_c").path
    (tmp_path / "main.c").write_text("int main(void) { return 0; }\n")
    for name, folder in folders.items():
        options = "".join(f"set(CONFIG_{n.upper()}_CONTROLLER y)\n" for n in ("circle20", name))
        adds = f"add_subdirectory({packages['circle20'].path}/zephyr one)\nadd_subdirectory({folder}/zephyr two)\n"
        checked = "mems_hexapod_checked_f32 " if name == "again" else ""
        whole = f"-Wl,--whole-archive circle20 mems_hexapod_online_f32 {checked}-Wl,--no-whole-archive"
        (tmp_path / "CMakeLists.txt").write_text(
            f"{ZEPHYR}{options}{adds}add_executable(app main.c)\ntarget_link_libraries(app PRIVATE {whole})\n"
        )
        words = [str(cmake), "-S", str(tmp_path), "-B", str(tmp_path / f"b_{name}")]
        done = subprocess.run(words, capture_output=True, text=True)
        if name == "again":
            assert done.returncode == 0, done.stderr
            run(cmake, "--build", tmp_path / f"b_{name}")
        else:
            assert done.returncode != 0 and "two controllers of one name" in " ".join(done.stderr.split())


def test_the_zephyr_module_says_what_zephyr_reads(packages):
    """Keys of scripts/zephyr_module.py: name, and the folder and the file that `build` names, which must be there."""
    for name, c in packages.items():
        lines = [line for line in (c.path / "zephyr" / "module.yml").read_text().splitlines() if line[:1] != "#"]
        assert lines == [f"name: {name}", "build:", "  cmake: zephyr", "  kconfig: zephyr/Kconfig"]
        assert (c.path / "zephyr" / "CMakeLists.txt").is_file()
        options = re.findall(r"^(?:config|choice) (\w+)$", (c.path / "zephyr" / "Kconfig").read_text(), re.MULTILINE)
        assert len(options) == 5 and all(option.startswith(f"{name.upper()}_CONTROLLER") for option in options)
        used = set(re.findall(r"CONFIG_(\w+)", (c.path / "zephyr" / "CMakeLists.txt").read_text()))
        assert used <= set(options)


def test_the_platformio_manifest_is_valid_and_builds_the_c_at_the_root(packages):
    for name, c in packages.items():
        manifest = json.loads((c.path / "library.json").read_text())
        assert {"name", "version", "description", "keywords", "authors"} <= set(manifest)
        assert (
            manifest["name"] == name and SEMANTIC.fullmatch(manifest["version"]) and len(manifest["description"]) < 1000
        )
        assert all((c.path / header).is_file() for header in manifest["headers"])
        (chosen,) = manifest["build"]["srcFilter"]
        built = {path.name for path in (c.path / manifest["build"]["srcDir"]).glob(chosen[2:-1])}
        assert built == {source.name for real in Real for source in c.sources(real)}


def test_the_arduino_manifest_has_every_required_field(packages):
    for name, c in packages.items():
        lines = (c.path / "library.properties").read_text().splitlines()
        fields = dict(line.split("=", 1) for line in lines if line)
        required = (
            "name",
            "version",
            "author",
            "maintainer",
            "sentence",
            "paragraph",
            "category",
            "url",
            "architectures",
        )
        assert all(fields.get(field) for field in required)
        assert fields["name"] == name and re.fullmatch(r"[A-Za-z0-9][\w .-]{0,62}", name)
        assert SEMANTIC.fullmatch(fields["version"]) and fields["version"] == __version__
        assert fields["category"] == "Device Control" and fields["url"].startswith("https://")
        assert all((c.path / header).is_file() for header in fields["includes"].split(","))


def test_the_arduino_sketch_builds_and_passes_with_a_stand_in_for_the_board(packages, objects, cpp, tmp_path):
    """A library without src/ is built from the C at its root, not from its subfolders."""
    c = packages["circle20"]
    assert not (c.path / "src").exists() and not (c.path / "utility").exists()
    (tmp_path / "Arduino.h").write_text(ARDUINO)
    (sketch,) = c.path.glob("examples/*/*.ino")
    assert sketch.stem == sketch.parent.name
    (tmp_path / "sketch.cpp").write_text(
        f'#include "Arduino.h"\n{sketch.read_text()}\nint main() {{ setup(); loop(); return 0; }}\n'
    )
    include = [f"-I{tmp_path}", f"-I{c.path}"]
    words = (cpp, "-std=c++11", *STRICT, *include, tmp_path / "sketch.cpp", *objects["circle20"])
    run(*words, "-o", tmp_path / "sketch")
    test = c.selftest[Real.FLOAT]
    told = re.search(rf"{test.upper()}_VECTORS (\d+)", (c.path / f"{test}.h").read_text())
    assert told and run(tmp_path / "sketch") == f"{told[1]} of {told[1]} vectors agree\n"
