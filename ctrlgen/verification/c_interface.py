"""What the generated C takes and gives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import Field

from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.core.units import base_unit, show
from ctrlgen.devices import Limit, Signal
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder
from ctrlgen.firmware.online.stated_pivot import StatedPivot
from ctrlgen.reporting.result_file import Keys
from ctrlgen.trajectory.solution import Solution

STATUS_WORDS = {
    ControllerStatus.DISPLACEMENT: "displacement beyond its range: the nearest target inside was taken",
    ControllerStatus.COMPOSITE: "a limit of several channels, such as a stress: displacement scaled toward home",
    ControllerStatus.STATE: "actuator state set to its limit",
    ControllerStatus.DRIVE: "drive at its limit: as far toward the target as it reaches in one sample",
    ControllerStatus.INPUT: "target is no number, or absurd: safe drives",
    ControllerStatus.LOST: "state is no number, absurd, or was not initialised: safe drives until it is",
    ControllerStatus.RATE: "drives change as fast as they may: the target is reached later",
    ControllerStatus.UNSURE: "what is believed of it may be wrong: it settles or rings, was called late, or was not known at the start",
    ControllerStatus.CLOCK: "not one sample has passed since the last call, of step_at",
}


class SignalChannels(Keys):
    """A signal of the C interface."""

    label: str = Field(description="The signal in words.")
    channels: list[str] = Field(description="'name [SI unit]', in the order of the C arrays.")


class StatusEntry(Keys):
    """One value of the controller's status."""

    value: int = Field(description="Its value in C, a bit of the status.")
    name: str = Field(description="Its name in C.")
    meaning: str = Field(description="What it tells the caller.")


class LimitEntry(Keys):
    """A limit that the controller keeps."""

    label: str = Field(description="The limited quantity in words.")
    lower: str | None = Field(description="Bound with its unit; null without one.")
    upper: str | None = Field(description="Bound with its unit; null without one.")


class Interface(Keys):
    """What the generated C takes and gives, in SI units."""

    functions: dict[str, list[str]] = Field(
        description="Signatures, by arithmetic; of integers the header says what they count."
    )
    target: SignalChannels = Field(description="What the controller is given at each sample.")
    drive: SignalChannels = Field(description="What it returns.")
    actuator_state: SignalChannels | None = Field(
        description="The actuators' states that it keeps account of; null for a device without any."
    )
    memory: list[str] = Field(description="'name [unit]' of what the controller keeps between samples.")
    status: list[StatusEntry] = Field(description="Values of the status.")
    limits: list[LimitEntry] = Field(description="Limits that the controller keeps.")


def interface(solution: Solution, c: CFolder) -> Interface:
    """The arguments and results of the C, in SI, and the values that its status can have."""
    model, scenario = solution.model, solution.scenario
    controller = controller_of(
        model, scenario.file.follow, scenario.sample_time, scenario.file.leads_modes, scenario.sample_times
    )
    kernels, m = controller.kernels, controller.kernels.nominal
    state, drive, rated = m.signals.get("state"), _channels(m.signals["drive"]), controller.rate is not None
    can = {
        ControllerStatus.COMPOSITE: bool(kernels.guarded_limits),
        ControllerStatus.STATE: controller.state_can_be_limited,
        ControllerStatus.RATE: rated,
        ControllerStatus.UNSURE: kernels.tells_of_itself,
        ControllerStatus.CLOCK: kernels.tells_of_itself or kernels.times is not None,
    }
    played: Mapping[Any, str] = c.player
    memory = [f"{name} [{unit}]" for name, unit in zip(m.x_names, m.x_units, strict=True)]
    return Interface(
        functions={
            real.value: _functions(
                name, bool(c.player), played.get(real), about=isinstance(real, Real) and StatedPivot(kernels).acts
            )
            for real, name in c.online.items()
        },
        target=_channels(kernels.target),
        drive=drive,
        actuator_state=None if state is None else _channels(state),
        memory=[
            *memory,
            *(f"displacement {axis} [m]" for axis in m.axes),
            *(f"last {channel}" for channel in drive.channels if rated),
        ],
        status=[
            StatusEntry(value=int(s), name=str(s.name), meaning=STATUS_WORDS[s])
            for s in ControllerStatus
            if can.get(s, True)
        ],
        limits=[_limit(limit) for limit in model.limits],
    )


def _channels(signal: Signal) -> SignalChannels:
    named = zip(signal.channels, signal.units, strict=True)
    return SignalChannels(label=signal.label, channels=[f"{c} [{base_unit(u)}]" for c, u in named])


def _limit(limit: Limit) -> LimitEntry:
    lower, upper = (None if bound is None else show(bound, limit.unit) for bound in (limit.lower, limit.upper))
    return LimitEntry(label=limit.label, lower=lower, upper=upper)


def _functions(online: str, moving: bool, player: str | None, *, about: bool) -> list[str]:
    """The calls of one arithmetic; `moving`: the device is driven sample by sample, `about`: it takes the poses of pivots."""
    played = [f"{player}_sample(index, drive)", f"{player}_at(time, drive)"] if player else []
    stepped = [f"{online}_step(state, target, out)"] if moving else []
    turned = [f"{online}_about(pivot, pose, target)"] if about else []
    return [f"{online}_init(state)", f"{online}_settle(state, target, out)", *stepped, *turned, *played]
