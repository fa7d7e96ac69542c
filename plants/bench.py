"""The generated C on the bench: built from the folder that `ctrlgen generate` writes, its powers fed to the plant.

Only files and commands: a main of a few lines prints the drives of the player, or of the online controller for commanded poses, and the
plant answers. The commanded poses come from trajectory.csv.
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

SCENARIO = ROOT / "scenarios" / "circle20"
DEVICE = ROOT / "scenarios" / "devices" / "mems_hexapod.toml"
PLAYED = """#include <stdio.h>
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
CONTROLLED = """#include <stdio.h>
#include "{name}.h"
#include "{constants}"
int main(void) {{
    static const {name}_constants specimen = {macro};
    {name}_state state;
    {name}_output out;
    double target[6];
    if ({name}_init_with(&state, &specimen) != 0) return 1;
    double *t = target;
    for (int first = 1; scanf("%lf %lf %lf %lf %lf %lf", t, t + 1, t + 2, t + 3, t + 4, t + 5) == 6; first = 0) {{
        if (first) {{ /* the bench waits until the device has settled */
            (void){name}_settle(&state, target, &out);
            if ({name}_elapsed(&state, {upper}_SETTLING, out.drive) != 0) return 2;
        }} else if ({name}_step(&state, target, &out) != 0) {{
            return 2;
        }}
        for (int i = 0; i < 6; ++i) printf("%.17g%c", out.drive[i], i < 5 ? ' ' : '\\n');
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


def scenario_of(folder: Path, device: Path, period: str | None = None, rate: str | None = None) -> Path:
    """The circle's scenario with a copy of `device` beside it, without its [[expect]], which the printed device alone meets; with
    another `period` and sample `rate` where they are given."""
    text = (SCENARIO / "scenario.toml").read_text(encoding="utf-8").partition("# What must come out")[0]
    for key, value in (("device", "device.toml"), ("duration", period), ("sample_rate", rate)):
        if value is not None:
            text = re.sub(rf"(?m)^{key} = .*$", f'{key} = "{value}"', text)
    here = folder / SCENARIO.name
    here.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(device, here / "device.toml")
    (here / "scenario.toml").write_text(text, encoding="utf-8")
    return here


def commanded(trajectory: Path) -> Array:
    """Commanded poses (n, 6) [rad, um] of a trajectory.csv."""
    columns = table(trajectory)
    return np.column_stack([columns[name] for name in CHANNELS])


def played(folder: Path) -> tuple[Array, float]:
    """Heater powers (n, 6) [W] that the player in `folder` puts out, compiled and run, and their rate [Hz]. Raises RuntimeError."""
    (source,) = folder.glob("*_player_f64.c")
    samples, rate = re.search(r"(\d+) samples of the heater powers .*?at ([\d.]+) Hz", _words(source)).groups()
    return _printed(source, PLAYED.format(name=source.stem, samples=samples), ""), float(rate)


def controlled(folder: Path, constants: Path, targets: Array) -> Array:
    """Heater powers (n, 6) [W] of the online controller in `folder`, started with the numbers of a specimen in `constants` (a C header),
    at `targets` (n, 6) [rad, um], a closed path that it follows until the powers repeat. Raises RuntimeError."""
    (source,) = folder.glob("*_online_f64.c")
    (macro,) = set(re.findall(r"#define (\w+_CONSTANTS_F64) ", constants.read_text(encoding="utf-8")))
    names = {"name": source.stem, "constants": constants.resolve(), "macro": macro}
    rows = np.tile(targets * np.repeat([1.0, 1e-6], 3), (2, 1))
    text = "".join(" ".join(f"{value:.17g}" for value in row) + "\n" for row in rows)
    return _printed(source, CONTROLLED.format(**names, upper=names["name"].upper()), text)[-len(targets) :]


def _printed(source: Path, main: str, given: str) -> Array:
    """The rows that a program of `main` and `source` prints, given a text on its standard input. Raises RuntimeError."""
    compiler = next((name for name in ("cc", "gcc", "clang") if shutil.which(name)), None)
    if compiler is None:
        raise RuntimeError("no C compiler: install gcc or clang")
    with tempfile.TemporaryDirectory(prefix="plants-") as scratch:
        text, program = Path(scratch) / "main.c", Path(scratch) / "main"
        text.write_text(main, encoding="utf-8")
        words = [compiler, "-std=c99", "-O2", "-Wall", "-Werror", f"-I{source.parent}", str(text), str(source), "-lm"]
        for command in ([*words, "-o", str(program)], [str(program)]):
            done = subprocess.run(command, input=given, capture_output=True, text=True)
            if done.returncode:
                raise RuntimeError(f"{Path(command[0]).name}: exit {done.returncode} {done.stderr.strip()}")
    return np.array([line.split() for line in done.stdout.splitlines()], dtype=float)


def _words(source: Path) -> str:
    """The C and its header, where the number of samples and the rate stand, in one line."""
    text = source.read_text(encoding="utf-8") + source.with_suffix(".h").read_text(encoding="utf-8")
    return " ".join(text.replace("*", " ").split())


def driven(plant: MemsHexapod, powers: Array, rate: float, command: Array, every: int = 10) -> Case:
    """The poses of the plant under periodic `powers` (n, 6) [W] at `rate` [Hz], heated through, beside those commanded.

    The bench heats with every sample, lag included; every `every`th pose is looked at.
    """
    a = plant.numbers.actuator
    periods = 1 + int(np.ceil(SETTLING * a.time_constant * rate / len(powers)))
    start = a.ambient + a.thermal_resistance * powers.mean(axis=0)
    T = temperatures(np.tile(powers, (periods, 1)), 1 / rate, a, start)[-len(powers) :]
    poses = [plant.pose(state) for state in plant.path(bar_force(T, a)[::every])]
    return Case(command[::every], np.array(poses))
