"""Families of laws: which of them a share speaks for. To which of them a law belongs stands in its own file.

A recording often tells the family and not the member: what is a function of the direction of motion is dry friction, whichever
of its laws. A kind speaks for the first family of its row; the others can look the same.
"""

from __future__ import annotations

from ctrlgen.diagnosis.shares.design import Kind
from ctrlgen.diagnosis.shares.shares_table import SharesTable
from ctrlgen.effects import Family, law_of

SPEAKS_FOR: dict[Kind, tuple[tuple[Family, ...], str]] = {
    Kind.DIRECTION: (
        (Family.FRICTION, Family.HYSTERESIS),
        "Coulomb's force changes its sign with the speed; play and hysteresis do after a short way",
    ),
    Kind.PROPORTION: (
        (Family.GAIN, Family.GEOMETRY),
        "a wrong stiffness, gain or lever; a turned frame, where several axes move a reading",
    ),
    Kind.POSITION: (
        (Family.ELASTIC, Family.GEOMETRY, Family.PERIODIC),
        "a force that does not rise in proportion, a weight on a joint, a stop, a bowed sensor, a few periods of a pitch go by place",
    ),
    Kind.SPEED: (
        (Family.DYNAMICS, Family.TIMING, Family.FRICTION),
        "viscous and drag forces; a reading late by tau is off by tau times the speed; friction that falls with speed",
    ),
    Kind.ACCELERATION: ((Family.DYNAMICS, Family.TIMING), "forces of inertia, a mass on a spring; a lag of the speed"),
    Kind.RATE: (
        (Family.TIMING, Family.DYNAMICS),
        "a reading late by tau is off by tau times its rate, one behind a filter also by its second derivative",
    ),
    Kind.DRIVE: (
        (Family.DRIVE, Family.GAIN, Family.ELASTIC),
        "dead zone, saturation, another gain by sign; in slow motion drive and position are one",
    ),
    Kind.TRAVEL_HISTORY: (
        (Family.HYSTERESIS, Family.FRICTION),
        "memory of the last reversals of the way, whatever the speed: sums of plays are Prandtl-Ishlinskii's hysteresis",
    ),
    Kind.DRIVE_HISTORY: (
        (Family.HYSTERESIS, Family.DRIVE),
        "memory of the last reversals of the drive: ferroelectric hysteresis, play of a gear behind the motor",
    ),
    Kind.OTHER_AXIS: (
        (Family.CROSS_TALK, Family.GEOMETRY),
        "what an axis of its own does not move: guides out of square, Abbe arms, turned frames, heat",
    ),
    Kind.DRIVE_LAG: (
        (Family.CREEP, Family.THERMAL, Family.DYNAMICS, Family.TIMING),
        "memory of a time constant: creep, slow heat, a second pole, a filter",
    ),
    Kind.PRODUCT: (
        (Family.CROSS_TALK, Family.ELASTIC, Family.HYSTERESIS),
        "second order of the kinematics, stiffness that another axis changes, hysteresis that differs by side",
    ),
    Kind.WARM_PRODUCT: (
        (Family.THERMAL, Family.CROSS_TALK),
        "a stiffness, a gain or a scale that changes with the surroundings' temperature",
    ),
    Kind.TEMPERATURE: ((Family.THERMAL,), "expansion, and sensors that see the surroundings"),
    Kind.RECORD: ((Family.GAIN, Family.EVENTS), "the zero point of each record, or what happened between them"),
    Kind.PITCH: ((Family.PERIODIC,), "fringes, teeth, slots, resolvers and screws repeat along the way"),
    Kind.TIME: ((Family.EVENTS, Family.THERMAL, Family.CREEP), "drift and ageing on the clock, whatever was done"),
    Kind.LINE: ((Family.EVENTS,), "vibration and mains repeat in time"),
    Kind.PAST: ((), "says that something is left that lasts longer than a sample, not what"),
}

OF_SEVERAL_AXES: dict[Kind, tuple[Family, ...]] = {Kind.DRIVE: (Family.GEOMETRY,)}
"""What a kind speaks for besides where several axes move a reading: of poses that follow their drives a turned frame is a function of
these, too."""


def family_of(kind: str) -> Family | None:
    """The family that a law states of itself; None without one, as for a number of the device."""
    law = law_of(kind)
    return law.family if law else None


def ranking(
    table: SharesTable, noise: dict[str, float] | None = None, linear: bool = True
) -> list[tuple[Family, float]]:
    """Families by the share that they could account for, the largest first; those with none are left out.

    Of each channel the gains of the selected kinds count for every family that their row names, and what a kind that was not
    selected adds counts where nothing selected speaks for the family. The mean and the device's numbers count for gain and
    offset. Of two with the same share the one that stands earlier in the rows goes first. Channels count by their energy over
    the variance of their `noise` [SI]; alike without it. Where `linear` is False, what is constant or in proportion counts for none.
    """
    weights = _weights(table, noise)
    share = dict.fromkeys(Family, 0.0)
    place = dict.fromkeys(Family, len(Family))
    for channel in table.channels:
        selected, beside = dict.fromkeys(Family, 0.0), dict.fromkeys(Family, 0.0)
        for row in (r for r in channel.kinds if linear or r.kind is not Kind.PROPORTION):
            more = OF_SEVERAL_AXES.get(row.kind, ()) if len(channel.axes) > 1 else ()
            for k, family in enumerate((*SPEAKS_FOR[row.kind][0], *more)):
                if row.selected:
                    selected[family] += row.additional
                    place[family] = min(place[family], k)
                else:
                    beside[family] = max(beside[family], row.additional)
        selected[Family.GAIN] += channel.constant + channel.numbers if linear else 0.0
        # friction without a change of direction is an offset
        if table.design.one_way(channel.axes):
            selected[Family.FRICTION] += channel.constant
        for family in Family:
            share[family] += weights[channel.channel] * (selected[family] or beside[family])
    shares = [(family, value) for family, value in share.items() if value > 0]
    return sorted(shares, key=lambda pair: (-round(pair[1], 3), place[pair[0]], list(Family).index(pair[0])))


def alone(table: SharesTable, noise: dict[str, float] | None = None) -> dict[Family, float]:
    """By family the share that a kind which speaks for it first predicts alone, channels weighed as in `ranking`.

    Two kinds may be nearly one signal, as the speed and the history of travel are in a sine: the one that is selected first then leaves
    nothing to the other, which says nothing against its family.
    """
    weights, share = _weights(table, noise), dict.fromkeys(Family, 0.0)
    for channel in table.channels:
        most = dict.fromkeys(Family, 0.0)
        for row in channel.kinds:
            for family in SPEAKS_FOR[row.kind][0][:1]:
                most[family] = max(most[family], row.alone.share)
        for family in Family:
            share[family] += weights[channel.channel] * most[family]
    return share


def _weights(table: SharesTable, noise: dict[str, float] | None) -> dict[str, float]:
    weights = {c.channel: (c.rms / noise[c.channel]) ** 2 if noise else 1.0 for c in table.channels}
    whole = sum(weights.values()) or 1.0
    return {channel: weight / whole for channel, weight in weights.items()}
