"""How large a machine is changes no finding: its length, its force and its drive are units like others.

By dimensional analysis what counts in one of them goes with it (E. Buckingham, Phys. Rev. 4 (1914) 345); what does not is listed here with
its reason.
"""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS, KF, M
from conftest import AXIS_FILE, DEVICES, SCENARIOS
from scaled_machines import USUAL, Scale, device_of, factor

from ctrlgen import load_device
from ctrlgen.core.units import split_unit, written_unit
from ctrlgen.devices import Device
from ctrlgen.devices.changed_numbers import with_numbers
from ctrlgen.effects import laws
from ctrlgen.estimation.hypothesis import PARAMETER, DataHints, Hypothesis, hypotheses, nominal_physics, numbers
from ctrlgen.estimation.number_sizes import sizes_of_numbers

AXES: tuple[Scale, ...] = ((1e-3, 1, 1), (1e3, 1e-3, 1e3), (0.1, 1e3, 1e-3))
OF_MATTER: tuple[Scale, ...] = ((1e-3, 1e-6, 1e-3), (100, 1e4, 100))  # with the stress, which matter bears at any size
PLACEHOLDERS = ("channel", "travel", "partner", "force")
# Not the two hexapods: their typical pose is a micrometre, which suits their interferometers, and not the travel that their files state
MACHINES = [
    *((file, scale) for file in (AXIS_FILE, SCENARIOS / "rack_pinion" / "device.toml") for scale in AXES),
    *((DEVICES / f"{name}.toml", scale) for name in ("rrr_case1", "tripod", "parallelogram") for scale in OF_MATTER),
]
EACH = pytest.mark.parametrize("file, scale", MACHINES, ids=[f"{f.parent.name}_{f.stem}-{s}" for f, s in MACHINES])
H = 1e-3
ARM = "how far from a point an instrument stands, whatever moves there: up to a metre, the size of a table"
TURN = "an angle, which a machine of any size may be turned by"
MATERIAL = "a property of matter per kelvin"
ROOM = "the temperature of a room, whatever stands in it"
ABSOLUTE = {
    "um/urad": ARM, "mm": ARM, "mrad": TURN, "deg": TURN, "1/K": MATERIAL, "channel/K": ROOM, "K": ROOM,
}  # fmt: skip
"""Why bounds may count in these units at a machine of any size; of times see test_law_paces.py."""


def suspected(device: Device) -> dict[tuple[str, str, str | None], Hypothesis]:
    physics = nominal_physics(device)
    read = tuple(f"reading.{channel}" for channel in physics.readings[0])
    return {(h.effect, h.location, h.of): h for h in hypotheses(device, physics, read, H, True)}


def hints(scale: Scale, device: Device, h: Hypothesis) -> DataHints:
    """Signals half as large as typical ones of the machine that is as it is; all of a second."""
    channel = h.channel_on(device)
    sizes = {
        "channel": channel.scale * factor(channel.unit, scale),
        "channel/s": channel.scale * factor(channel.unit, scale),
    }
    sizes |= dict.fromkeys(("travel", "travel/s"), channel.travel_scale * factor(channel.travel_unit, scale))
    return DataHints({**{unit: size / 2 for unit, size in sizes.items()}, "s": 0.5}, duration=6.0)


def test_bounds_count_in_typical_sizes_or_there_is_a_reason_why_they_do_not():
    left = {}
    for kind, law in laws().items():
        for p in law.params:
            rest = split_unit(p.unit, (*PLACEHOLDERS, "s", "Hz", "ms"))[1]
            if rest != "dimensionless":
                left.setdefault(p.unit, []).append((kind, p.name))
    assert left.keys() == ABSOLUTE.keys(), left


@EACH
def test_every_law_is_sought_in_the_sizes_of_its_machine(file, scale):
    usual, other = device_of(file), device_of(file, scale)
    here, there = suspected(usual), suspected(other)
    assert not here.keys() ^ there.keys()
    compared = 0
    for key, h in here.items():
        if h.effect == PARAMETER:
            continue
        one, two = h.channel_on(usual), there[key].channel_on(other)
        assert two.scale == pytest.approx(one.scale * factor(one.unit, scale), rel=1e-9), key
        shapes = h.shapes(one, hints(USUAL, usual, h)), there[key].shapes(two, hints(scale, usual, h))
        assert len(shapes[0]) == len(shapes[1]), key
        for p in h.law.params:
            if p.unit in ABSOLUTE:
                continue
            times = factor(one.unit_of(p), scale)
            assert there[key].bounds(p, two) == pytest.approx(np.multiply(h.bounds(p, one), times), rel=1e-9), (key, p)
            for a, b in zip(*shapes, strict=True):
                if p.name in a:
                    assert b[p.name] == pytest.approx(a[p.name] * times, rel=1e-9), (key, p)
            compared += times != 1
    assert compared > 5


@EACH
def test_every_number_is_suspected_in_the_size_of_its_machine(file, scale):
    """Those that are zero too, of which the file says only what is beside them."""
    usual, other = device_of(file), device_of(file, scale)
    sizes, found = sizes_of_numbers(usual), sizes_of_numbers(other)
    for path, _, number in numbers(usual):
        times = factor(written_unit(number.text), scale)
        assert found[path] == pytest.approx(sizes[path] * times, rel=1e-9), path
        assert sizes[path] == pytest.approx(abs(number.si)) if number.si else sizes[path] > 0


def test_a_zero_is_as_large_as_the_rest_of_the_file_makes_it():
    """A coordinate by the drawing; a stiffness F/D and a damping sqrt(m F/D) by the motor, the stroke and the mass."""
    free = with_numbers(AXIS, {"mechanics.damping": 0.0, "mechanics.stiffness": 0.0})
    full = KF * AXIS.actuator.drive_limit.si / AXIS.mechanics.stroke.si
    sizes = sizes_of_numbers(free)
    assert sizes["mechanics.stiffness"] == pytest.approx(full) and sizes["mechanics.damping"] == pytest.approx(
        (M * full) ** 0.5
    )
    assert sizes["mechanics.mass"] == M
    drawing = sizes_of_numbers(load_device(DEVICES / "tripod.toml"))
    assert drawing["element[0].at[1]"] == pytest.approx(0.02 * 30e-3)  # of the farthest element
