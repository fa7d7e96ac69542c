"""What a law is where one of its shapes ends at a bound: itself still, or another law, under whose name it belongs.

Every shape of every law that is suspected has an entry, `ITSELF` where the law keeps its name there or nothing is known of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class ShapeBounds:
    """What a law is where a shape is at its `low` or `high` bound, where the records say nothing of it (`untold`), and where it does what
    the law's size does and no more (`as_size`), as a friction that is still in proportion to the speed does; empty: the law itself, or
    nothing is known. A fit that ends there is rejected."""

    low: str = ""
    high: str = ""
    untold: str = ""
    as_size: str = ""


def _any(other: str) -> ShapeBounds:
    return ShapeBounds(low=other, high=other, untold=other)


ITSELF = ShapeBounds()
_GAIN = _any("a gain")
_LOOP_BESIDE_GAIN = replace(_any("a gain beside a smaller loop"), untold="")
# a force that slips after no way is dry friction, and one that never slips a spring
_SLIPS = _any("dry friction, or a spring")
_SINGLE_PLAY = ShapeBounds(low="a single play, or a gain")
# a contact that yields farther, or not at all, is one still
_CONTACT = {"reach": ITSELF}
# tanh(v/v_s) far below v_s is v/v_s, and the force grows as v_s does
_CREEPING = {**_CONTACT, "smoothing": ShapeBounds(high="viscous damping", as_size="viscous damping")}
_EVENT = {"moment": ITSELF, "rise": ITSELF}
_WAVE = {"period": ITSELF, "phase": ITSELF}
_LINE = {"frequency": ITSELF, "phase": ITSELF}


def _falling(plain: str) -> dict[str, ShapeBounds]:
    """Friction whose excess over sliding is none, or lasts at every speed, is the `plain` one."""
    return {"breakaway": ShapeBounds(low=plain), "speed": ShapeBounds(high=plain), **_CONTACT}


def _above(everywhere: str) -> dict[str, ShapeBounds]:
    """An edge below all that is recorded has no other side."""
    return {"edge": ShapeBounds(low=everywhere), "width": ITSELF}


def _below(everywhere: str) -> dict[str, ShapeBounds]:
    return {"edge": ShapeBounds(high=everywhere), "width": ITSELF}


_FRICTION, _STEADY = "dry friction everywhere", "dry friction that does not fall with speed"
_DAMPING, _PLAY, _SPRING = "damping everywhere", "play everywhere", "another stiffness everywhere"
_ASYMMETRIC_LAG = {
    "reach": _GAIN,
    "taper": ITSELF,
    "reversible": _LOOP_BESIDE_GAIN,
    **dict.fromkeys(("upper", "lower", "side"), ITSELF),
}
_WEIGHTED_LAG = {
    "reach": _GAIN,
    "reversible": _LOOP_BESIDE_GAIN,
    **{f"part{j}": ITSELF for j in range(1, 8)},
}

AT_BOUNDS: Mapping[str, Mapping[str, ShapeBounds]] = {
    "asymmetric_displacement_hysteresis": _ASYMMETRIC_LAG,
    "asymmetric_drive_hysteresis": _ASYMMETRIC_LAG,
    "asymmetric_hysteresis": {"reach": _SLIPS, "skew": ITSELF},
    "backlash_above": _above(_PLAY),
    "backlash_below": _below(_PLAY),
    "bouc_wen": {"reach": _SLIPS, "loop": ITSELF},
    "butterfly": {"linear": ITSELF, "reach": ITSELF, "taper": ITSELF},
    "cogging": _WAVE,
    "cogging_of_slots": {**_WAVE, "sine": ITSELF, "cosine": ITSELF},
    "coulomb": _CREEPING,
    "coulomb_above": {**_CREEPING, **_above(_FRICTION)},
    "coulomb_after": {**_CREEPING, **_EVENT},
    "coulomb_below": {**_CREEPING, **_below(_FRICTION)},
    # what has followed within a millisecond crept nowhere
    "creep": {"tau": ShapeBounds(low="a gain, or a lag"), "slow": ITSELF},
    "cyclic": _WAVE,
    "dead_zone": {"rounding": ITSELF},
    "degradation": {"levels_off": ITSELF},
    "directional_friction": {"skew": ITSELF, **_CONTACT},
    "displacement_bouc_wen": {"reach": _GAIN, "loop": ITSELF},
    "displacement_hysteresis": {"reach": _GAIN, "taper": _SINGLE_PLAY, "reversible": _LOOP_BESIDE_GAIN},
    "drive_gain_beyond": {"level": ShapeBounds(low="a gain of the drive")},
    "drive_hysteresis": {"reach": _GAIN, "taper": _SINGLE_PLAY},
    "end_stop": {"gap": ITSELF, "power": ITSELF},
    "force_step": _EVENT,
    "gravity": {"phase": ITSELF},
    "hysteresis": {"reach": _SLIPS, "taper": ITSELF},
    "local_error": {"position": ITSELF, "length": ITSELF, "rounding": ITSELF},
    "log_creep": {"tau": ITSELF, "decades": ITSELF},
    "lost_beams": _EVENT,
    "low_pass": {"tau": ITSELF, "damping": ITSELF},
    "payload": {"lean": ITSELF},
    "quantisation": {"quantum": ITSELF},
    "resonance": {"frequency": ITSELF, "damping": ITSELF},
    "saturation": {"level": ITSELF},
    "second_pole": {"tau": ITSELF},
    "sensor_step": _EVENT,
    "slack_friction": {"slack": ITSELF, "reach": ITSELF},
    "stiffness_above": {"edge": ShapeBounds(low=_SPRING)},
    "stiffness_below": {"edge": ShapeBounds(high=_SPRING)},
    "stiffness_beyond": {"edge": ShapeBounds(low=_SPRING)},
    "stitching_error": {"position": ITSELF, "width": ITSELF},
    "stribeck": _falling(_STEADY),
    "stribeck_above": {**_falling(_STEADY), **_above(_FRICTION)},
    "stribeck_after": {**_falling(_STEADY), **_EVENT},
    "stribeck_below": {**_falling(_STEADY), **_below(_FRICTION)},
    "stuck": {"level": ITSELF},
    # far from where it is right, it is off by nearly the same at every temperature
    "temperature_sensitivity": {"reference": replace(_any("an offset"), untold="")},
    "temperature_sensitivity_above": {"reference": ShapeBounds(low="an error of every temperature")},
    "thermal_lag": {"tau": ITSELF, "second": ITSELF},
    "vibration": _LINE,
    "viscous_above": _above(_DAMPING),
    "viscous_at_speed": {"speed": ShapeBounds(low=_DAMPING)},
    "viscous_below": _below(_DAMPING),
    "weighted_displacement_hysteresis": _WEIGHTED_LAG,
    "weighted_drive_hysteresis": _WEIGHTED_LAG,
    "worn_backlash": {"wear": ITSELF},
}
"""By law and shape."""
