"""The player alone, of a device whose drives the online C cannot compute: nothing but the solved drives is needed."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np

from ctrlgen.controller.null_motion import why_no_null_motion
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import write_text
from ctrlgen.core.units import common_base_unit
from ctrlgen.firmware.c.templates import write
from ctrlgen.firmware.package import LICENCE, MANIFEST, input_files
from ctrlgen.firmware.player.compression import compress
from ctrlgen.firmware.player.player_context import player_context
from ctrlgen.model.model import Model
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.trajectory.solution import Solution
from ctrlgen.version import __version__, commit, program


def check_online(scenario: Scenario, model: Model) -> None:
    """Raises InputError for a device, or a scenario of it, whose drives the online C cannot compute yet."""
    faults, player = [], "use the player (`ctrlgen solve`, `ctrlgen generate --player`)"
    yet = f"the online C cannot keep to that yet: {player}"
    if scenario.file.feedforward == "static":
        faults.append(Fault("feedforward", f"is static, in a scenario; {yet}"))
    if model.rate_limits and scenario.sample_time is None:
        rates = ", ".join(limit.label for limit in model.rate_limits)
        what = f"is missing, and the device has limits on rates of drives ({rates}): give sample_rate and duration"
        faults.append(Fault("sample_rate", what))
    if (why := why_no_null_motion(model)) is not None:
        faults.append(Fault("device", f"{why}: {player}"))
    if any(limit.upper is not None for limit in model.composite_limits()) and (away := _ranges_without_home(model)):
        what = (
            f"moves {away} in a range that leaves out where it rests, toward which a displacement is scaled where another limit is met: "
            f"{player}, or let the range begin or end there"
        )
        faults.append(Fault("device", what))
    if model.redundant and model.device.given_at_start:
        faults.append(Fault("run_time", f"is of a device with more drives than axes; {yet}, or leave [run_time] out"))
    if faults:
        raise InputError(model.name, faults)


def _ranges_without_home(model: Model) -> str:
    """The axes whose displacement cannot be zero."""
    low, high = model.z_bounds
    return ", ".join(axis for axis, outside in zip(model.axes, (low > 0) | (high < 0), strict=True) if outside)


def generate_player(solution: Solution, out: Path) -> list[Path]:
    """Writes the player in double and float, the inputs and a manifest to `out`; the paths of its C. Raises InputError where the
    scenario has no sample rate."""
    scenario, model = solution.scenario, solution.model
    if scenario.sample_time is None:
        what = "is missing: a player replays drives in time; write sample_rate and duration"
        raise InputError(scenario.path, [Fault("sample_rate", what)])
    drive, written = model.signals["drive"], []
    for real, compression in compress(solution).items():
        name = f"{scenario.name}_player_{real.suffix}"
        context = player_context(solution, compression, name) | {
            "real": real,
            "drive": drive,
            "drive_unit": common_base_unit(drive.units),
            "nu": len(drive.channels),
            "motion": model.inertial,
            "program": program(),
            "version": __version__,
            "digest": scenario.digest,
            "u_safe": np.clip(0.0, *model.u_bounds),
            "source": model.device.source,
        }
        written += [write(f"player.{kind}", context, out / f"{name}.{kind}") for kind in ("h", "c")]
    texts = {f"device/{path}": text for path, text in input_files(scenario).items()}
    for name, text in texts.items():
        write_text(out / name, text)
    names = [*(path.name for path in written), *texts]
    manifest = {
        "name": scenario.name,
        "title": scenario.file.title,
        "ctrlgen": __version__,
        "commit": commit(),
        "licence": LICENCE,
        "inputs": scenario.digest,
        "files": {name: hashlib.sha256((out / name).read_bytes()).hexdigest() for name in sorted(names)},
    }
    write_text(out / MANIFEST, json.dumps(manifest, indent=1) + "\n")
    return [path for path in written if path.suffix == ".c"]
