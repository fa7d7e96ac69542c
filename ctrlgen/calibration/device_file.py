"""device.calibrated.toml: the device file as its author wrote it, with the constants of one specimen."""

from __future__ import annotations

import os
from pathlib import Path

import tomlkit

from ctrlgen.calibration.calibrate import Calibration
from ctrlgen.core.edited_toml import replace_quantity, sd_text, value_text, with_moved_files
from ctrlgen.core.files import read_text, write_text
from ctrlgen.devices.python_file import as_toml

NAME = "device.calibrated.toml"


def write_calibrated_device(calibration: Calibration, original: Path, target: Path) -> None:
    """Writes `target` from the device file `original`: each constant that the recording determined with its value, standard deviation
    and source; as their new default in [run_time] too. Raises InputError where `original` cannot be read."""
    python = original.suffix == ".py"
    text = as_toml(calibration.device, os.path.relpath(original, target.parent)) if python else read_text(original)
    text = text if python else with_moved_files(text, calibration.device.names_files, original, target)
    document, known = tomlkit.parse(text), dict(calibration.device.quantities())
    for row in calibration.constants:
        if not row.determined:
            continue
        c, old = row.constant, known[row.constant.path]
        was = f"was {old.text}" + (f", {old.source}" if old.source else "")
        fields = {"value": value_text(row.value, c.unit), "sd": sd_text(row.sd, c.unit)}
        fields["source"] = f"calibrated from {calibration.recording.title}; {was}"
        replace_quantity(document, c.path, {k: v for k, v in fields.items() if v})
    write_text(target, document.as_string())
