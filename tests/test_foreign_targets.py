"""The generated C on other machines than the one that made it, in other dialects, with a stranger's options: the same bits, call by call.

Where a compiler is told to keep more digits than a number has, or to round a product and a sum at once, the last digits differ, and
`test_compiler_flags.py` holds that no number passes that is none.
"""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest
from conftest import DEVICE, ROOT, SCENARIOS
from traced_calls import BOARD, numbers, program

from ctrlgen import build_model, generate, load_scenario, solve
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder

STRICT = ("-std=c99", "-O2", "-ffp-contract=off")
STRANGE = ("-funsigned-char", "-fshort-enums", "-funsigned-bitfields", "-fno-strict-aliasing", "-fwrapv", "-fno-common")
SECTIONS = ("-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections")
BOARD_WORDS = (
    "-nostartfiles",
    "--specs=rdimon.specs",
    "-T",
    str(ROOT / "codegen" / "templates" / "board.ld.j2"),
    "-Wl,--defsym=end=0x20200000",
)
QEMU = ("-nographic", "-monitor", "none", "-serial", "none", "-chardev", "stdio,id=sh")
QEMU += ("-semihosting-config", "enable=on,target=native,chardev=sh", "-kernel")
M7 = ("-mcpu=cortex-m7", "-mthumb", "-mfpu=fpv5-d16", "-mfloat-abi=hard")
M4 = ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
M3 = ("-mcpu=cortex-m3", "-mthumb", "-mfloat-abi=soft")


@dataclass(frozen=True)
class Target:
    """A compiler with its options, what runs its programs, how both are installed, and the arithmetics that are tried."""

    words: tuple[str, ...]
    runner: tuple[str, ...] = ()
    install: str = "apt-get install gcc"
    reals: tuple[Real, ...] = tuple(Real)
    board: bool = False


MULTILIB = "apt-get install gcc-12-multilib g++-12-multilib libc6-dev-i386"
POWERPC = "apt-get install gcc-powerpc-linux-gnu libc6-dev-powerpc-cross qemu-user"
ARM = "apt-get install gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm"
# Fused products where the options let a compiler fuse them are left out by -ffp-contract=off, as in FLAGS
TARGETS = {
    "no optimisation": Target(("gcc", "-std=c99", "-O0", "-ffp-contract=off")),
    "all optimisation": Target(("gcc", "-std=gnu11", "-O3", "-flto", "-ffp-contract=off")),
    "small": Target(("gcc", "-std=c11", "-Os", "-ffp-contract=off", *SECTIONS)),
    "strange": Target(("gcc", *STRICT, *STRANGE)),
    "C23": Target(("gcc", "-std=c2x", "-O2", "-ffp-contract=off")),
    "C++98": Target(("g++", "-x", "c++", "-std=c++98", "-O2", "-ffp-contract=off"), (), "apt-get install g++"),
    "C++20": Target(("g++", "-x", "c++", "-std=c++20", "-O2", "-ffp-contract=off"), (), "apt-get install g++"),
    "clang": Target(("clang", *STRICT, *STRANGE[:2]), (), "apt-get install clang"),
    "clang++": Target(("clang++", "-x", "c++", "-std=c++17", "-Os", "-ffp-contract=off"), (), "apt-get install clang"),
    "32 bits": Target(("gcc", "-m32", "-msse2", "-mfpmath=sse", *STRICT), (), MULTILIB),
    "big-endian": Target(("powerpc-linux-gnu-gcc", *STRICT, "-static"), ("qemu-ppc",), POWERPC),
    "Cortex-M7": Target(
        ("arm-none-eabi-gcc", *M7, *STRICT, *SECTIONS),
        ("qemu-system-arm", "-M", "mps2-an500", *QEMU),
        ARM,
        board=True,
    ),
    "Cortex-M4": Target(
        ("arm-none-eabi-gcc", *M4, *STRICT, *STRANGE),
        ("qemu-system-arm", "-M", "mps2-an386", *QEMU),
        ARM,
        board=True,
    ),
    "Cortex-M3": Target(
        ("arm-none-eabi-gcc", *M3, "-std=c11", "-Os", "-ffp-contract=off", *SECTIONS),
        ("qemu-system-arm", "-M", "mps2-an385", *QEMU),
        ARM,
        board=True,
    ),
}
# Whose arithmetic keeps more digits than a number has, or rounds a product and a sum at once
ROUNDING = {
    "x87": Target(("gcc", "-m32", "-mno-sse", "-mfpmath=387", "-std=c99", "-O2"), (), MULTILIB),
    "x87 of GNU": Target(("gcc", "-m32", "-mno-sse", "-mfpmath=387", "-std=gnu11", "-O2"), (), MULTILIB),
    "fused": Target(("gcc", "-march=native", "-std=gnu11", "-O3", "-ffp-contract=fast")),
    "fused, Cortex-M7": Target(
        ("arm-none-eabi-gcc", *M7, "-std=gnu11", "-O3", "-ffp-contract=fast"),
        ("qemu-system-arm", "-M", "mps2-an500", *QEMU),
        ARM,
        board=True,
    ),
}
KINDS = {  # beside the circle: one of each kind of controller, and of player
    "inertia": ("flexure_axis_line", ""),
    "coupled": ("lever_circle", ""),
    "equilibria": ("tripod_tilt", ""),
    "table": ("xy_stage_force", ""),
    "checksum and times": ("circle20", 'checksum = true\nsample_times = ["0.5 ms", "2 ms"]\n'),
    "given at the start": ("circle20", ""),
}


def answers(folder: CFolder, real: Real, target: Target, scratch: Path) -> list[str]:
    """What the program of `traced_calls` prints there; skips where a tool is missing or compiles nothing for the target."""
    for tool in (target.words[0], *target.runner[:1]):
        if not shutil.which(tool):
            pytest.skip(f"{tool} is missing: the C was not tried on this target; {target.install}")
    (scratch / "main.c").write_text(program(folder, real))
    sources, words = [scratch / "main.c", *folder.sources(real)], target.words
    if target.board:
        (scratch / "board.c").write_text(BOARD)
        sources.append(scratch / "board.c")
        words = (*words, *BOARD_WORDS)
    built = subprocess.run(
        [*words, f"-I{folder.path}", *map(str, sources), "-o", str(scratch / "main")], capture_output=True, text=True
    )
    if built.returncode and not can_compile(target, scratch):
        pytest.skip(f"{target.words[0]} has no library for this target; {target.install}")
    assert built.returncode == 0, built.stderr
    command = [*target.runner, str(scratch / "main")]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert ran.returncode == 0, ran.stdout[:200] + ran.stderr
    return ran.stdout.splitlines()


def can_compile(target: Target, scratch: Path) -> bool:
    (scratch / "empty.c").write_text("#include <stdio.h>\nint main(void) { return 0; }\n")
    words = [word for word in target.words if not word.startswith("-Wl")]
    return subprocess.run([*words, "-c", "empty.c"], cwd=scratch, capture_output=True).returncode == 0


@pytest.fixture(scope="module")
def folders(circle_c, tmp_path_factory) -> dict[str, CFolder]:
    """The C of each kind."""
    made = {"circle": circle_c}
    for kind, (name, more) in KINDS.items():
        text = (SCENARIOS / name / "scenario.toml").read_text().split("[[expect]]")[0]
        text = text.replace("../devices", str(DEVICE.parent))
        if kind == "given at the start":
            text = text.replace("mems_hexapod.toml", "mems_hexapod_run_time.toml")
        home = tmp_path_factory.mktemp("kind")
        (home / "scenario.toml").write_text(more + text)
        scenario = load_scenario(home)
        solution = solve(scenario, build_model(scenario.device, sample_time=scenario.sample_time))
        made[kind] = generate(scenario, solution.model, home / "c", solution)
    return made


@pytest.fixture(scope="module")
def expected(compiler, tmp_path_factory):
    """What the C answers on this computer."""
    known: dict[tuple[Path, Real], list[str]] = {}

    def of(folder: CFolder, real: Real) -> list[str]:
        if (folder.path, real) not in known:
            lines = answers(folder, real, Target((compiler, *STRICT)), tmp_path_factory.mktemp("here"))
            assert len(lines) > 500
            known[folder.path, real] = lines
        return known[folder.path, real]

    return of


@pytest.mark.parametrize("real", list(Real))
@pytest.mark.parametrize("name", ["C++98", "32 bits", "big-endian", "Cortex-M7"])
def test_the_circles_c_answers_the_same_bits_on_a_strangers_target(name, real, circle_c, expected, tmp_path):
    assert answers(circle_c, real, TARGETS[name], tmp_path) == expected(circle_c, real)


@pytest.mark.parametrize("real", list(Real))
@pytest.mark.parametrize("name", list(ROUNDING))
def test_another_rounding_changes_no_status_and_no_more_than_digits(name, real, circle_c, expected, tmp_path):
    """Of every kind of answer the largest difference, in the largest number that it ever has."""
    largest: dict[str, float] = {}
    off: dict[str, float] = {}
    there = answers(circle_c, real, ROUNDING[name], tmp_path)
    for mine, other in zip(expected(circle_c, real), there, strict=True):
        (status, wanted), (told, got) = numbers(mine, real), numbers(other, real)
        assert told == status
        what = status.rpartition(" ")[0]
        largest[what] = max([largest.get(what, 0.0), *map(abs, wanted)])
        off[what] = max([off.get(what, 0.0), *(abs(a - b) for a, b in zip(wanted, got, strict=True))])
    assert largest and all(off[what] <= 100 * real.epsilon * largest[what] for what in largest), (off, largest)


@pytest.mark.long
@pytest.mark.parametrize("real", list(Real))
@pytest.mark.parametrize("kind", ["circle", *KINDS])
@pytest.mark.parametrize("name", list(TARGETS))
def test_every_kind_of_c_answers_the_same_bits_on_every_target(name, kind, real, folders, expected, tmp_path):
    assert answers(folders[kind], real, TARGETS[name], tmp_path) == expected(folders[kind], real)
