"""Dead channels, which read one constant value: left out of every fit, and a finding where the device should move them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import difference, show
from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.direct_detection import unfitted_finding
from ctrlgen.diagnosis.selection.findings import Finding
from ctrlgen.diagnosis.settings import DIRECT_DETECTION
from ctrlgen.effects import Channel, Effect, Place
from ctrlgen.estimation.hypothesis import nominal_physics, selected_laws
from ctrlgen.estimation.raw_readings import detect_directly
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.effect_terms import channels
from ctrlgen.recordings.recording import Recording


@dataclass(frozen=True, eq=False)
class LiveChannels:
    """A recording without its dead channels, the findings on those, and a note on each."""

    recording: Recording
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()


def without_dead_channels(
    device: Device, recording: Recording, laws: Sequence[type[Effect]] | None = None
) -> LiveChannels:
    """The recording without channels that read one constant value; a finding by one of the `laws` (None: all) for each of
    them that should vary. Raises InputError where every channel is constant."""
    moving = [r for r in recording.records if r.role != "rest"]
    values = [np.concatenate([r.observed[r.valid[:, i], i] for r in moving]) for i in range(len(recording.channels))]
    dead = {i: float(y[0]) for i, y in enumerate(values) if len(y) and np.ptp(y) == 0}
    if not dead:
        return LiveChannels(recording)
    if len(dead) == len(recording.channels):
        faults = [
            Fault(
                f"columns.{recording.channels[i]!r}",
                f"reads {show(level, recording.units[i])} in all records: the sensor is dead or stuck, or the "
                "column is wrong; nothing can be compared with the device",
            )
            for i, level in dead.items()
        ]
        raise InputError(recording.title, faults)
    structure = Structure(device)
    predicted = [structure.simulator(recording.channels, r.timing).simulate(r, structure.start) for r in moving]
    places = {f"reading.{c.name}": c for c in channels(nominal_physics(device), Place.SENSOR)}
    findings, notes = [], []
    for i, level in dead.items():
        name, unit = recording.channels[i], recording.units[i]
        travel = float(np.ptp(np.concatenate([y[:, i] for y in predicted])))
        moves = f"the device as described moves it by {travel * difference(1.0, unit):.3g} {unit}"
        notes.append(f"{name}: reads {show(level, unit)} in every sample, {moves}; it is left out of every fit.")
        channel = places.get(name)
        if channel is not None and travel > DIRECT_DETECTION.dead_motion * channel.scale:
            findings += [unfitted_finding(law, channel, read) for law, read in _detected(channel, values[i], laws)]
    return LiveChannels(
        _only(recording, [i for i in range(len(recording.channels)) if i not in dead]), tuple(findings), tuple(notes)
    )


def _detected(
    channel: Channel, values: np.ndarray, laws: Sequence[type[Effect]] | None
) -> Iterator[tuple[type[Effect], dict[str, float]]]:
    """Sensor laws that constant readings show, with their parameters [SI]."""
    for law in selected_laws() if laws is None else laws:
        if law.place is Place.SENSOR and law.applies_to(channel) and (seen := detect_directly(law, values)) is not None:
            yield law, seen[0]


def _only(recording: Recording, kept: list[int]) -> Recording:
    """The recording of the channels `kept` alone."""
    channels, units = (tuple(row[i] for i in kept) for row in (recording.channels, recording.units))
    noise, tolerance = (tuple(row[i] for i in kept) for row in (recording.noise, recording.tolerance))
    place = {i: k for k, i in enumerate(kept)}
    records = tuple(
        replace(
            r,
            observed=r.observed[:, kept],
            valid=r.valid[:, kept],
            spikes=tuple((row, place[i], size) for row, i, size in r.spikes if i in place),
            held=tuple((a, b, place[i]) for a, b, i in r.held if i in place),
        )
        for r in recording.records
    )
    return replace(recording, channels=channels, units=units, noise=noise, tolerance=tolerance, records=records)
