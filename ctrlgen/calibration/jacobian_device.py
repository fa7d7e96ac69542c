"""device.calibrated.toml of a calibrated Jacobian: a stage by its matrix, which the commands take as any device."""

from __future__ import annotations

import numpy as np

from ctrlgen.calibration.measured_jacobian import MeasuredJacobian
from ctrlgen.core.edited_toml import sd_text, toml_text, value_text
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.pose_errors import CHANNELS

REACH = 1.05
"""Of the largest recorded drive to either side: the range of the drives, so that a recorded pose is not at its end; no farther than the
described device goes, unless a drive was recorded there. Of what is beyond nothing was measured."""
PER_DIRECTION = {"theta": "urad", "delta": "um"}


def device_text(found: MeasuredJacobian) -> str:
    """The device file: entries with standard deviations, each drive within what was recorded, followed as the device described is.

    Where there are fewer drives than components of the pose, those are followed that the described device follows, the others read.
    """
    model = build_model(found.device)
    drive, followed = model.signals["drive"], model.signals["pose"].channels
    followed = CHANNELS if len(drive.channels) == len(CHANNELS) else tuple(followed)
    fitted = int((~found.held_out).sum())
    source = f"{found.recording.title}: {found.numbers} numbers fitted to {fitted} poses"
    rows = []
    for name, values, deviations in zip(CHANNELS, found.jacobian, found.sd, strict=True):
        entries = []
        for value, sd, unit in zip(values, deviations, drive.units, strict=True):
            per = f"{PER_DIRECTION[name.split('_')[0]]}/{unit}"
            fields = {"value": value_text(value, per), "sd": sd_text(sd, per), "source": "fitted"}
            entries.append(toml_text({key: text for key, text in fields.items() if text}))
        rows.append("  [ # " + name + "\n" + "".join(f"    {entry},\n" for entry in entries) + "  ],\n")
    lines = [
        'kind = "matrix"',
        f"name = {toml_text(found.device.name + '_measured')}",
        f"title = {toml_text('a measured Jacobian of ' + found.device.title)}",
        f"source = {toml_text('ctrlgen calibrate --jacobian; ' + source)}",
        f"directions = {list(CHANNELS)}".replace("'", '"'),
        f"jacobian = [ # a column for each actuator: {', '.join(drive.channels)}\n{''.join(rows)}]",
        f"channels = {list(followed)}".replace("'", '"'),
    ]
    read = [name for name in CHANNELS if name not in followed]
    lines += [f"readings = {read}".replace("'", '"')] if read else []
    drives = np.vstack([np.zeros(len(drive.channels)), *(r.drive for r in found.recording.records)])
    (least, most), (low_end, high_end) = (drives.min(axis=0), drives.max(axis=0)), model.u_bounds
    lowest = np.minimum(least, np.maximum(REACH * least, low_end))
    highest = np.maximum(most, np.minimum(REACH * most, high_end))
    for name, unit, *ends in zip(drive.channels, drive.units, lowest, highest, strict=True):
        low, high = (value_text(end, unit, digits=6) for end in ends)
        lines += [
            "",
            "[[actuator]]",
            f"name = {toml_text(name)}",
            f"low = {toml_text(low)}",
            f"high = {toml_text(high)}",
        ]
    return "\n".join(lines) + "\n"
