"""Disturbance inputs at every place of a device: how a term of any law there reaches the readings."""

from __future__ import annotations

import casadi as ca

from ctrlgen.core.units import Quantity
from ctrlgen.devices import Device, DevicePhysics, ImposedPhysics
from ctrlgen.effects import Effect, Expression, LawInputs, LawNumbers, Param, Place
from ctrlgen.model.effect_terms import available, channels


class _DisturbanceInput(Effect, listed=False):
    """Delta = delta, constant within a sample."""

    source = "definition"
    asks = True  # behind a spring of no stiffness nothing reads the displacement
    params = (Param("delta", "channel", (-1.0, 1.0), "the disturbance", off=0.0),)

    def __init__(self, place: Place, at: str, unit: str) -> None:
        super().__init__(at, {"delta": Quantity(0.0, f"0 {unit}")})
        self.place = place  # type: ignore[misc]  # one class stands for all places

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return p.delta


def with_disturbance_inputs(device: Device, physics: DevicePhysics) -> tuple[Device, dict[tuple[Place, int], str]]:
    """The device with a disturbance input on every channel of every place, and the path of each by place and channel index."""
    inputs: list[_DisturbanceInput] = []
    paths: dict[tuple[Place, int], str] = {}
    unread = unread_axes(device, physics)
    for place in Place:
        if place is Place.HEAT and "heat" not in available(physics):
            continue
        for i, channel in enumerate(channels(physics, place)):
            if place is Place.DISPLACEMENT and i in unread:
                continue
            paths[place, i] = f"effect[{len(device.effect) + len(inputs)}].delta"
            inputs.append(_DisturbanceInput(place, channel.name, channel.unit))
    return device.model_copy(update={"effect": (*device.effect, *inputs)}), paths


def unread_axes(device: Device, physics: DevicePhysics) -> frozenset[int]:
    """The axes of an imposed motion on whose displacement no force depends, whatever the device's numbers."""
    if not isinstance(physics, ImposedPhysics):
        return frozenset()
    bare = device.model_copy(update={"effect": ()})
    any_numbers = {path: ca.SX.sym(path) for path, number in bare.quantities() if not number.whole}
    general = bare.physics(bare.values(any_numbers))
    # as with the device's own numbers
    assert isinstance(general, ImposedPhysics)
    d = ca.SX.sym("d", len(physics.axes))
    forces = ca.vertcat(general.restoring_force(d), general.force(general.drive.expr, d))
    return frozenset(i for i in range(d.numel()) if not ca.depends_on(forces, d[i]))
