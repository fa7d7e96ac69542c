"""The generated C on the bench: built from the folder that `ctrlgen generate` writes, its powers fed to the plant.

Only files and commands: the player's header says how many samples it has and at what rate, a main of a few lines prints the drive of each,
and the plant answers. The trajectory's commanded poses come from trajectory.csv.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from plants.cases import CHANNELS, ROOT, Case, table
from plants.frame import Array
from plants.mems_hexapod import MemsHexapod, bar_force, temperatures

MAIN = """#include <stdio.h>
#include "{name}.h"
int main(void) {{
    double drive[6];
    for (unsigned long k = 0; k < {samples}; ++k) {{
        if ({name}_sample(k, drive) < 0) return 1;
        for (int i = 0; i < 6; ++i) printf("%.17g%c", drive[i], i < 5 ? ' ' : '\\n');
    }}
    return 0;
}}
"""
SETTLING = 10.0  # time constants after which the start of a periodic drive is forgotten: 5e-5


def ctrlgen(*words: str, progress: bool = False) -> str:
    """Runs `ctrlgen WORDS` as a user would; what it prints, `progress` on its stderr shown. Raises RuntimeError with what is wrong."""
    shown = None if progress else subprocess.PIPE
    done = subprocess.run(
        [sys.executable, "-m", "ctrlgen", *words], cwd=ROOT, stdout=subprocess.PIPE, stderr=shown, text=True
    )
    if done.returncode:
        raise RuntimeError(
            f"ctrlgen {' '.join(words)}: exit {done.returncode}: {(done.stderr or done.stdout or '').strip()}"
        )
    return done.stdout


def played(folder: Path) -> tuple[Array, float]:
    """Heater powers (n, 6) [W] that the C of `folder` puts out, compiled and run, and their rate [Hz]. Raises RuntimeError."""
    compiler = next((name for name in ("cc", "gcc", "clang") if shutil.which(name)), None)
    if compiler is None:
        raise RuntimeError("no C compiler: install gcc or clang")
    (source,) = folder.glob("*_player_f64.c")
    samples, rate = re.search(r"(\d+) samples of the heater powers .*?at ([\d.]+) Hz", _words(source)).groups()
    with tempfile.TemporaryDirectory(prefix="plants-") as scratch:
        main, program = Path(scratch) / "main.c", Path(scratch) / "main"
        main.write_text(MAIN.format(name=source.stem, samples=samples), encoding="utf-8")
        words = [compiler, "-std=c99", "-O2", "-Wall", "-Werror", f"-I{folder}", str(main), str(source), "-lm"]
        for command in ([*words, "-o", str(program)], [str(program)]):
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                raise RuntimeError(f"{command[0]}: {done.stderr.strip()}")
    return np.array([line.split() for line in done.stdout.splitlines()], dtype=float), float(rate)


def _words(source: Path) -> str:
    """The C and its header, where the number of samples and the rate stand, in one line."""
    text = source.read_text(encoding="utf-8") + source.with_suffix(".h").read_text(encoding="utf-8")
    return " ".join(text.replace("*", " ").split())


def driven(plant: MemsHexapod, folder: Path, trajectory: Path, every: int = 10) -> Case:
    """The poses of the plant under the powers of the C in `folder`, periodic and heated through, beside those commanded.

    The bench heats with every sample of the C, lag included; every `every`th pose is looked at.
    """
    powers, rate = played(folder)
    a = plant.numbers.actuator
    periods = 1 + int(np.ceil(SETTLING * a.time_constant * rate / len(powers)))
    start = a.ambient + a.thermal_resistance * powers.mean(axis=0)
    T = temperatures(np.tile(powers, (periods, 1)), 1 / rate, a, start)[-len(powers) :]
    poses = [plant.pose(state) for state in plant.path(bar_force(T, a)[::every])]
    columns = table(trajectory)
    command = np.column_stack([columns[name] for name in CHANNELS])
    return Case(command[::every], np.array(poses))
