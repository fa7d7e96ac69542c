"""Two generated packages for the tests of them, and how those build."""

from __future__ import annotations

import subprocess
from pathlib import Path

from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.toolchains import FLAGS
from ctrlgen.firmware.folder import CFolder

UNSURE = int(ControllerStatus.UNSURE)
# Stand-ins: the four CMake functions of Zephyr that a module calls, and what a sketch of Arduino calls
ZEPHYR = """cmake_minimum_required(VERSION 3.16)
project(app C)
add_library(interface INTERFACE)
function(zephyr_include_directories)
  target_include_directories(interface INTERFACE ${ARGN})
endfunction()
function(zephyr_library_named name)
  add_library(${name} STATIC)
  target_link_libraries(${name} PUBLIC interface)
  set(ZEPHYR_CURRENT_LIBRARY ${name} PARENT_SCOPE)
endfunction()
function(zephyr_library_sources)
  target_sources(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()
"""
ARDUINO = """#include <cstdio>
struct {
    void begin(long) {}
    void print(int v) { std::printf("%d", v); }
    void print(const char *t) { std::printf("%s", t); }
    void println(const char *t) { std::puts(t); }
} Serial;
"""
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")


def run(*words: object, cwd: Path | None = None) -> str:
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, cwd=cwd)
    assert done.returncode == 0, f"{words}: status {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout


def everything(packages: dict[str, CFolder]) -> str:
    """A main that includes every header of all packages, calls every piece and every selftest."""
    headers = [h.name for c in packages.values() for h in sorted(c.path.glob("*.h"))]
    calls = ""
    for k, (c, real) in enumerate((c, real) for c in packages.values() for real in Real):
        test, online, player, vectors = (names[real] for names in (c.selftest, c.online, c.player, c.vectors))
        calls += f"""    {{
        {test}_result r;
        {online}_state state;
        {online}_output out;
        {online}_init(&state);
        /* without UNSURE, which a device that settles has */
        if (({online}_settle(&state, {vectors}_target[0], &out) & ~{UNSURE}U) != {vectors}_status[0]) {{ return {4 * k + 1}; }}
        if ({player}_sample({vectors}_played[0], out.drive) != 0) {{ return {4 * k + 2}; }}
        if (({test}(&r) != 0) || (r.compared != {test.upper()}_VECTORS)) {{ return {4 * k + 3}; }}
    }}
"""
    return "".join(f'#include "{h}"\n' for h in headers) + f"int main(void)\n{{\n{calls}    return 0;\n}}\n"


def build(compiler: str, sources: list[Path], out: Path, *more: str) -> None:
    """Compiles with the flags of the verification."""
    done = subprocess.run([compiler, *FLAGS, *more, *map(str, sources), "-o", str(out)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
