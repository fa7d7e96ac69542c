"""The generated folder as a library of Arduino, built by its own tools and run on an emulated board."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
from pathlib import Path

import pytest
from conftest import SCENARIOS

from ctrlgen import build_model, generate, load_scenario
from ctrlgen.firmware.c.real import Real

pytestmark = pytest.mark.long

TOOLS = ("arduino-builder", "avr-gcc", "qemu-system-avr", "gcc")
BOARD = "arduino:avr:mega:cpu=atmega2560"
CALLS = 5
TARGET = "{ 0.0f, 0.0f, 0.0f, 1e-5f, 0.0f, 2e-5f }"
STEPS = """static {name}_state state;
static {name}_output out;
static const float target[6] = {target};
static uint32_t step(void) {{ return {name}_step(&state, target, &out); }}
static uint32_t bits(int i) {{ uint32_t b; memcpy(&b, &out.drive[i], sizeof b); return b; }}
"""
SKETCH = """#include <{name}.h>
{steps}
void setup()
{{
    Serial.begin(115200);
    {name}_init(&state);
    for (int k = 0; k < {calls}; k++) {{
        Serial.print(step(), HEX);
        for (int i = 0; i < 6; i++) {{
            Serial.print(' ');
            Serial.print(bits(i), HEX);
        }}
        Serial.println();
    }}
    Serial.println("end");
}}
void loop() {{}}
"""
PROGRAM = """#include <{name}.h>
#include <stdio.h>
#include <string.h>
{steps}
int main(void)
{{
    {name}_init(&state);
    for (int k = 0; k < {calls}; k++) {{
        printf("%lX", (unsigned long)step());
        for (int i = 0; i < 6; i++) {{
            printf(" %lX", (unsigned long)bits(i));
        }}
        printf("\\n");
    }}
    printf("end\\n");
    return 0;
}}
"""


def built(folder: Path, sketch: Path, out: Path) -> Path:
    """The program of a sketch that arduino-builder makes with the library in `folder`."""
    share = Path(str(shutil.which("arduino-builder"))).parent.parent / "share"
    tools = Path(str(shutil.which("avr-gcc"))).parent
    out.mkdir()
    words = [
        "arduino-builder",
        "-compile",
        "-fqbn",
        BOARD,
        "-libraries",
        folder,
        "-build-path",
        out,
        "-warnings",
        "none",
    ]
    words += ["-hardware", share / "arduino" / "hardware", "-hardware", share / "arduino-builder"]
    words += ["-tools", tools, "-prefs", f"compiler.path={tools}/", "-prefs", f"tools.ctags.path={tools}"]
    # Debian's core asks for it, which its compiler's float.h does not define in C++
    words += ["-prefs", "compiler.cpp.extra_flags=-DDECIMAL_DIG=9", sketch]
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out / f"{sketch.name}.elf"


def said(program: Path) -> str:
    """What a program of the board says on its serial line, until it ends."""
    words = ["qemu-system-avr", "-M", "mega2560", "-bios", str(program), "-display", "none", "-serial", "stdio"]
    lines = [""]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True) as board:
        try:
            while board.stdout and lines[-1] != "end" and (line := board.stdout.readline()):
                lines.append(line.strip())
        finally:
            board.kill()
    return "\n".join(lines[1:])


def test_an_arduino_mega_computes_the_same_bits(tmp_path):
    """Eight-bit AVR, floats in software: the circle's controller, from rest to where it stays."""
    missing = [tool for tool in TOOLS if not shutil.which(tool)]
    if missing:
        what = "apt-get install arduino-builder arduino-core-avr qemu-system-misc"
        pytest.skip(f"{', '.join(missing)} missing, nothing was built for Arduino: {what}")
    scenario = load_scenario(SCENARIOS / "circle20")
    c = generate(scenario, build_model(scenario.device), tmp_path / "libraries" / "circle20")
    name = c.online[Real.FLOAT]
    words = {"name": name, "calls": CALLS, "steps": STEPS.format(name=name, target=TARGET)}
    (tmp_path / "steps").mkdir()
    sketch = tmp_path / "steps" / "steps.ino"
    sketch.write_text(SKETCH.format(**words))
    (tmp_path / "steps.c").write_text(PROGRAM.format(**words))
    host = tmp_path / "host"
    flags = ["-std=c99", "-ffp-contract=off", f"-I{c.path}", "-o", str(host)]
    subprocess.run(["gcc", *flags, str(tmp_path / "steps.c"), str(c.path / f"{name}.c")], check=True)
    expected = subprocess.run([str(host)], capture_output=True, text=True, check=True, env=os.environ).stdout.strip()
    drives = [struct.unpack("!f", bytes.fromhex(f"{word:0>8}"))[0] for word in expected.splitlines()[-2].split()[1:]]
    assert all(0 < drive < 1 for drive in drives)  # W: they do something
    assert said(built(tmp_path / "libraries", sketch, tmp_path / "built")) == expected
