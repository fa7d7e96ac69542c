"""A device driven by a file or by a step: every signal as a table and a picture, and the limits that it comes nearest to."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import whole_folder, write_bytes, write_text
from ctrlgen.core.units import from_si, parse
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import Trace, simulate
from ctrlgen.recordings.look.drive_file import DriveFile, read_drives
from ctrlgen.reporting.line_patterns import dashes, mark
from ctrlgen.reporting.plots import COLOURS, STYLE, image, legend_above
from ctrlgen.trajectory.inverse.violations import Violation, violations
from ctrlgen.trajectory.unstated_modes import with_internal_modes

MOST_SAMPLES = 2_000_000  # with a dozen signals these fill 200 MB
WITH_MODES = "pose_with_modes"
BEFORE = 0.1  # of a step's duration: at rest


@dataclass(frozen=True)
class Simulated:
    """What came out: the `model`, its `trace`, with the pose as it is with the modes of the bodies where the model leaves them out, what
    was `measured` [SI] by reading."""

    model: Model
    trace: Trace
    measured: Mapping[str, np.ndarray]

    @property
    def broken(self) -> list[Violation]:
        """The limits of the device that the motion breaks, where its laws need not hold, those that miss most first."""
        n = len(self.trace.time)
        return violations(self.model, self.trace.x, self.trace.z, self.trace.signals["drive"][:n])

    def error(self, reading: str) -> float:
        """Rms of measured less simulated [SI]."""
        role, _, channel = reading.partition(".")
        i = self.model.signals[role].channels.index(channel)
        n = len(self.measured[reading])
        return float(np.sqrt(np.nanmean((self.measured[reading] - self.trace.signals[role][:n, i]) ** 2)))


def simulate_device(device: Path, drives: Path | None, step: str | None, duration: float, rate: float) -> Simulated:
    """The device at `device` from rest, under the drives of a file, or under a `step`, "1 V" or "1X=0.1 W, 2X=0.2 W", for a `duration`
    [s] at a `rate` [Hz]. Raises InputError, and SolverError where the motion has no end."""
    described = load_device(device)
    model = build_model(described)
    if (drives is None) == (step is None):
        raise InputError("simulate", [Fault("drives", "name a file of drives, or give --step, one of the two")])
    given = stepped(step or "", duration, rate, model) if drives is None else read_drives(drives, model)
    model = build_model(described, sample_time=given.sample_time)  # with the laws that look back by samples
    found = simulate(model, given.u, given.sample_time)
    if (pose := with_internal_modes(model, found)) is not None:
        label = "pose with the bodies' modes"
        signal = replace(model.signals["pose"], name=WITH_MODES, label=label, column=f"{WITH_MODES}.")
        signals = {**found.described, WITH_MODES: signal}
        found = replace(found, signals={**found.signals, WITH_MODES: pose}, described=signals)
    return Simulated(model, found, given.measured)


def stepped(text: str, duration: float, rate: float, model: Model) -> DriveFile:
    """Drives that are zero and, after a tenth of the duration, step to `text`. Raises InputError."""
    drive, n = model.signals["drive"], round(duration * rate)
    if not 10 <= n <= MOST_SAMPLES:
        what = f"gives {number_of(n, 'sample')} at {rate:g} Hz; 10 to {MOST_SAMPLES} are simulated"
        raise InputError("--duration", [Fault(f"{duration:g} s", what)])
    u = np.zeros((n, len(drive.channels)))
    for part in re.split(r",(?=[^,=]*=)", text):  # a comma within a number is told by what reads it
        name, _, value = part.rpartition("=")
        name = name.strip() or (drive.channels[0] if len(drive.channels) == 1 else "")
        if name not in drive.channels:
            what = (
                f"is no drive; write {drive.channels[0]}=1{drive.units[0]}; the drives are {', '.join(drive.channels)}"
            )
            raise InputError("--step", [Fault(part.strip(), what)])
        i = drive.channels.index(name)
        try:
            u[int(BEFORE * n) :, i] = parse(value.strip(), drive.units[i])
        except ValueError as error:
            raise InputError("--step", [Fault(part.strip(), str(error))]) from None
    return DriveFile(u, 1 / rate, {})


def write_simulated(result: Simulated, folder: Path) -> None:
    """signals.csv, every signal with its unit, and signals.svg, into `folder`, whole or not at all. Raises InputError."""
    with whole_folder(folder) as draft:
        write_text(draft / "signals.csv", table(result))
        write_bytes(draft / "signals.svg", draw(result))


def table(result: Simulated) -> str:
    """The signals as CSV: time [s], then role.channel [unit]."""
    names, columns = ["time [s]"], [result.trace.time]
    for role, signal in result.trace.described.items():
        for i, (channel, unit) in enumerate(zip(signal.channels, signal.units, strict=True)):
            names.append(f"{role}.{channel} [{unit}]")
            columns.append(from_si(result.trace.signals[role][:, i], unit))
    quoted = [f'"{name}"' if "," in name else name for name in names]
    lines = [",".join(f"{v:.9g}" for v in row) for row in zip(*columns, strict=True)]
    return "\n".join([",".join(quoted), *lines]) + "\n"


def draw(result: Simulated) -> bytes:
    """A panel a signal, over time; measured readings as dots."""
    with plt.rc_context(STYLE):
        return image(draw_signals(result), ".svg")


def draw_signals(result: Simulated) -> Figure:
    """The same as a figure."""
    roles: list[str] = [role for role in ("drive", "reading") if role in result.model.signals]
    roles += [r for r in result.trace.described if r not in (*roles, "pose")]
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(len(roles), figsize=(8.2, 0.6 + 1.9 * len(roles)), sharex=True, squeeze=False)
        for panel, role in zip(axes[:, 0], roles, strict=True):
            signal, values = result.trace.described[role], result.trace.signals[role]
            for i, channel in enumerate(signal.channels):
                colour = COLOURS[i % len(COLOURS)]
                seen = result.measured.get(f"{role}.{channel}")
                if seen is not None:
                    panel.plot(
                        result.trace.time[: len(seen)],
                        from_si(seen, signal.units[i]),
                        mark(i),
                        ms=2,
                        color=colour,
                        alpha=0.5,
                    )
                told = from_si(values[:, i], signal.units[i])
                panel.plot(result.trace.time, told, lw=1.1, ls=dashes(i), color=colour, label=channel)
            panel.set_ylabel(f"{signal.label}\n[{signal.units[0]}]", fontsize=8)
            if len(signal.channels) > 1:
                legend_above(panel, size=7)
        axes[-1, 0].set_xlabel("time [s]")
        return figure
