"""What fastest.json holds of a fastest motion, key by key."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ctrlgen.core.units import difference, from_si, same_dimension
from ctrlgen.path_timing.binding import Binding
from ctrlgen.path_timing.fastest import FastestPath
from ctrlgen.path_timing.repetition import Repetition
from ctrlgen.reporting.result_file import Keys, Number, Origin, origin


class Times(Keys):
    """Time along the path, of a closed one for one period [s]; null where there is no such motion."""

    stated: Number = Field(description="As the scenario states it; null for one without a duration.")
    own_law: Number = Field(description="Shortest by the scenario's own law of time, in whole samples.")
    even_speed: Number = Field(description="Shortest at even speed along the path, in whole samples.")
    fastest: float = Field(description="Of the set-points, in whole samples.")
    continuous: float = Field(
        description="Shortest that was found in continuous time; none is shorter where each place alone bounds the speed."
    )


class BindingEntry(Keys):
    """A limit that binds along the path."""

    limit: str = Field(description="Name of the limit.")
    label: str = Field(description="The limited quantity in words.")
    channel: str = Field(description="Its channel.")
    side: Literal["lower", "upper"] = Field(description="Which bound.")
    bound: float = Field(description="The bound.")
    unit: str = Field(description="Its unit.")
    time_s: float = Field(description="Time for which it binds [s].")
    share_of_time: float = Field(description="The same as a share of the shortest time.")
    runs: list[tuple[float, float]] = Field(description="Where it binds: from and to which share of the path.")


class LawEntry(Keys):
    """The fastest law of time in continuous time, at its nodes."""

    time_s: list[float] = Field(description="Time [s].")
    share: list[float] = Field(description="Share of the path that is behind.")
    speed: list[Number] = Field(description="Its change by time [1/s]; null where nothing bounds it.")
    bound: list[Number] = Field(
        description="Largest speed that each place alone allows [1/s]; null where it is not known."
    )


class RepetitionEntry(Keys):
    """The largest path that can be repeated at a frequency, larger or smaller about its middle; null where none can."""

    frequency_hz: float = Field(description="How often a second.")
    scale: Number = Field(description="Scale of the scenario's path, by the fastest law of time.")
    scale_even_speed: Number = Field(description="Scale at even speed.")
    scale_set_points: Number = Field(description="Scale of the set-points in at_frequency/, which keep all limits.")
    diameter: Number = Field(description="Diameter of a circle by the fastest law of time.")
    diameter_even_speed: Number = Field(description="Diameter at even speed.")
    diameter_unit: str = Field(description="Unit of the diameters; empty where the path is no circle.")


class FastestRecord(Origin):
    """Result of `ctrlgen fastest`: the shortest time in which a path can be followed, its law of time, and what bounds it."""

    scenario: str = Field(description="Name of the scenario.")
    title: str = Field(description="Title of the scenario file.")
    device: str = Field(description="Name of the device.")
    signal: str = Field(description="The followed signal.")
    closed: bool = Field(description="Whether the path is periodic.")
    sample_rate_hz: float = Field(description="Rate of the set-points [Hz].")
    set_points: int = Field(description="How many there are.")
    times: Times = Field(description="The motions compared.")
    bindings: list[BindingEntry] = Field(description="The limit that binds for the longest time first.")
    between_set_points: dict[str, float] = Field(
        description="Largest distance from the path between set-points, by 'channel [unit]'."
    )
    law: LawEntry = Field(description="The law of time.")
    set_point_shares: list[float] = Field(description="Share of the path that is behind at each set-point.")
    repetition: RepetitionEntry | None = Field(description="What can be repeated at --frequency; null without it.")


def fastest_record(path: FastestPath) -> FastestRecord:
    """Plain numbers in the stated units."""
    scenario, law = path.scenario, zip(("time_s", "share", "speed", "bound"), path.optimum.law(), strict=True)
    signal = path.solution.model.signals[scenario.file.follow]
    between = zip(signal.channels, map(small_unit, signal.units), path.between, strict=True)
    return FastestRecord(
        **origin(scenario.digest, None, path.notes),
        scenario=scenario.name,
        title=scenario.file.title,
        device=path.solution.model.name,
        signal=scenario.file.follow,
        closed=path.curve.closed,
        sample_rate_hz=1 / path.sample_time,
        set_points=len(path.solution.command),
        times=Times(
            stated=path.given,
            own_law=path.stated,
            even_speed=path.even,
            fastest=path.duration,
            continuous=path.optimum.duration,
        ),
        bindings=[_binding(b) for b in path.bindings],
        between_set_points={f"{c} [{u}]": float(difference(v, u)) for c, u, v in between},
        law=LawEntry(**{name: values.tolist() for name, values in law}),
        set_point_shares=path.share.tolist(),
        repetition=None if path.repetition is None else _repetition(path.repetition),
    )


def _binding(b: Binding) -> BindingEntry:
    limit = b.side.limit
    return BindingEntry(
        limit=limit.name,
        label=limit.label,
        channel=b.side.name,
        side="upper" if b.side.upper else "lower",
        bound=float(from_si(b.side.bound, limit.unit)),
        unit=limit.unit,
        time_s=b.time,
        share_of_time=b.share_of_time,
        runs=list(b.runs),
    )


def _repetition(r: Repetition) -> RepetitionEntry:
    return RepetitionEntry(
        frequency_hz=r.frequency,
        scale=r.scale,
        scale_even_speed=r.even,
        scale_set_points=r.sampled,
        diameter=r.size(r.scale),
        diameter_even_speed=r.size(r.even),
        diameter_unit=r.unit,
    )


def small_unit(unit: str) -> str:
    """nm and urad, in which errors are told."""
    return next((small for small in ("nm", "urad") if same_dimension(unit, small)), unit)
