"""Which names and places are right for what was planted, the values that parameters should have, and units."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from battery.laws_drive import ARRIVING, BREAKING

# Truth -> names that are right. Two names stand together where the physics is one law under two names, or where moving a
# linear law along the chain changes nothing that a recording could show (a lag in the actuator, a relaxation in the flexure).
FORCE_CONSTANT = "parameter@force_constant"
ACCEPTED: dict[str, tuple[str, ...]] = {
    "softening": ("stiffening",),
    "hysteresis": ("hysteresis", "bouc_wen"),
    "creep": ("creep", "log_creep", "power_creep", "thermal_lag", "second_pole"),
    "log_creep": ("log_creep", "creep", "power_creep"),
    "thermal_lag": ("thermal_lag", "second_pole", "creep"),
    "viscous": ("viscous", "asymmetric_viscous"),
    "step": ("step", "force_step"),
    "frame_turn": ("frame_turn", "frame_rotation_z"),
    "low_pass": ("low_pass", "thermal_lag"),
    "cogging": ("cogging", "cogging_from_home", "cogging_of_slots"),
    "cyclic": ("cyclic", "cyclic_from_home"),
    "vibration": ("vibration", "vibration_per_record"),
    "coulomb": ("coulomb",),
    "stribeck": ("stribeck",),
    "drive_gain": ("drive_gain", "sensor_gain", FORCE_CONSTANT),
    "sensor_gain": ("sensor_gain", "drive_gain", FORCE_CONSTANT),
    "stiffness": ("stiffness", "parameter@stiffness"),
    "finite_rotation": ("finite_rotation",),
}
# Of a memory: words in the names that are right
FAMILIES = {
    "hysteresis": ("hysteresis", "bouc_wen", "preisach"),
    "backlash": ("backlash", "play"),
    "creep": ("creep", "thermal_lag", "second_pole"),
}
# Truth -> how the names begin that are right for a law in a region: which region is judged apart
IN_A_REGION = {
    **dict.fromkeys(("friction_there", "friction_between", "friction_from", "stick_from"), ("coulomb", "stribeck")),
    "friction_one_way": ("directional_friction", "coulomb", "stribeck"),
    **dict.fromkeys(("damping_there", "damping_between", "damping_fast"), ("viscous",)),
    **dict.fromkeys(("knee", "stop_there"), ("end_stop", "stiffness_")),
    "scratch": ("scratch", "local_error"),
    "gain_beyond": ("saturation", "drive_gain"),
    "play_there": ("backlash",),
    "warm_reading": ("temperature_sensitivity",),
}
# Truth, or family of a memory -> families of the model-free shares that are right
_CREEPS = ("creep", "thermal")
EVIDENCE = {
    **dict.fromkeys(("coulomb", "stribeck", "friction_there", "friction_from", "stick_from"), ("dry friction",)),
    **dict.fromkeys(("friction_between", "friction_one_way"), ("dry friction",)),
    **dict.fromkeys(("hysteresis", "backlash", "play_there"), ("hysteresis",)),
    **dict.fromkeys(("stiffening", "softening", "end_stop", "knee", "stop_there"), ("elastic nonlinearity",)),
    **dict.fromkeys(("saturation", "dead_zone", "gain_beyond"), ("drive nonlinearity",)),
    **dict.fromkeys(("drive_gain", "sensor_gain", "stiffness", "home_offset"), ("gain and offset",)),
    **dict.fromkeys(("coupling", "heat_crosstalk"), ("cross-talk",)),
    **dict.fromkeys(("viscous", "quadratic_damping", "resonance"), ("dynamics",)),
    **dict.fromkeys(("damping_there", "damping_between", "damping_fast"), ("dynamics",)),
    **dict.fromkeys(("creep", "log_creep", "thermal_lag"), _CREEPS),
    **dict.fromkeys(("delay", "low_pass"), ("timing",)),
    **dict.fromkeys(("bow", "frame_turn", "finite_rotation", "scratch"), ("sensor geometry",)),
    **dict.fromkeys(("cyclic", "cogging"), ("periodic sensor error",)),
    **dict.fromkeys(("temperature_sensitivity", "warm_reading"), ("thermal",)),
    **dict.fromkeys(("drift", "degradation", "lost_beams", "step", "vibration"), ("events and disturbances",)),
}
# Truth -> another name of the very same law and numbers
SAME_LAW = {
    "step": "force_step",
    "frame_turn": "frame_rotation_z",
    "free_play": "backlash",
}
# Places that are right beside the law's own, for the same reason.
ALSO_AT = {
    "thermal_lag": ("actuator", "stage"),
    "creep": ("actuator", "stage"),
    "log_creep": ("actuator", "stage"),
    "low_pass": ("sensor", "actuator"),
    "drive_gain": ("actuator", "sensor"),
    "sensor_gain": ("sensor", "actuator"),
    "stiffness": ("stage", "mechanics"),
    "lost_beams": ("actuator", "stage"),  # a weaker actuator, as a drive or as a force
    "degradation": ("actuator", "stage"),
    "step": ("disturbance", "stage"),
    "vibration": ("disturbance", "stage", "sensor"),  # one line is one line, wherever it enters
    "parameter": ("mechanism", "actuator", "stage", "hexapod"),
}
Value = Callable[[dict[str, Any]], float]


def _middle(truth: dict[str, Any], takes: float) -> float:
    """The moment [s] of an event that begins at its planted one: the middle, all that records tell of one within a sample."""
    return truth["shape"]["moment"] + takes / 2


# Parameters whose law has the same form in the plant and in any library: aliases of the name, and the value in SI.
TRUTHS: dict[str, dict[tuple[str, ...], Value]] = {
    "drive_gain": {("gain",): lambda t: t["amplitude"]},
    "sensor_gain": {("gain",): lambda t: t["amplitude"]},
    "home_offset": {("offset",): lambda t: t["amplitude"]},
    "delay": {("delay", "time", "tau"): lambda t: t["amplitude"]},
    "cyclic": {("period", "pitch", "wavelength"): lambda t: t["shape"]["period"]},
    "temperature_sensitivity": {("sensitivity", "gain", "slope"): lambda t: t["amplitude"]},
    "quadratic_damping": {("c2", "coefficient", "drag", "damping"): lambda t: t["amplitude"]},
    "vibration": {("frequency",): lambda t: t["shape"]["frequency"]},
    "step": {
        ("amplitude", "size", "height", "force"): lambda t: t["amplitude"],
        ("moment", "time"): lambda t: _middle(t, ARRIVING),
    },
    "lost_beams": {
        ("share", "fraction", "lost"): lambda t: t["amplitude"],
        ("moment", "time"): lambda t: _middle(t, BREAKING),
    },
    "resonance": {("frequency",): lambda t: t["shape"]["frequency"]},
    "heat_crosstalk": {("share",): lambda t: t["amplitude"]},
    "frame_turn": {("angle",): lambda t: t["amplitude"]},
}
# In messy cases and with memory
ROUGH_TRUTHS: dict[str, dict[tuple[str, ...], Value]] = TRUTHS | {
    "backlash": {("gap",): lambda t: t["amplitude"]},
    "free_play": {("gap",): lambda t: t["amplitude"]},
}
BASE = {
    "": 1.0,
    "1": 1.0,
    "%": 1e-2,
    "m": 1.0,
    "s": 1.0,
    "Hz": 1.0,
    "N": 1.0,
    "V": 1.0,
    "A": 1.0,
    "W": 1.0,
    "K": 1.0,
    "kg": 1.0,
    "g": 1e-3,
    "rad": 1.0,
    "deg": math.pi / 180,
    "degC": 1.0,
    "min": 60.0,
    "ohm": 1.0,
    "Pa": 1.0,
}
PREFIX = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6, "G": 1e9, "p": 1e-12}


def in_si(value: float, unit: str) -> float:
    """`value` in SI; units as 'nm', 'N*s/m', 'N/um^3', 'm/(s*K)'. Raises ValueError for what it does not know."""
    factor, sign = 1.0, 1
    for token in re.findall(r"[*/()·]|[^*/()·\s]+", unit.replace("**", "^")):
        if token in "*·":
            continue
        if token == "/":
            sign = -1  # everything after the one stroke is below it: units here carry one
            continue
        if token in "()":
            continue
        name, _, power = token.partition("^")
        if name not in BASE and (name[:1] not in PREFIX or name[1:] not in BASE):
            raise ValueError(f"unit {unit!r}: {name!r} is not known to battery.judge")
        one = BASE[name] if name in BASE else PREFIX[name[0]] * BASE[name[1:]]
        factor *= one ** (sign * float(power or 1))
    return value * factor


def is_right(effect: str, location: str, truth: dict[str, Any]) -> bool:
    """Whether the name of a finding is right for a planted law; for a memory, whether its family is."""
    if truth.get("family"):
        return any(word in effect for word in FAMILIES[truth["family"]])
    if truth["name"] in IN_A_REGION:
        return effect.startswith(IN_A_REGION[truth["name"]])
    if effect in truth.get("also", ()):
        return True
    for name in ACCEPTED.get(truth["name"], (truth["name"],)):
        wanted, _, number = name.partition("@")
        if effect == wanted and (not number or location.endswith(":" + number)):
            # of 'any number off nominal' the number is part of the name
            return not (truth["name"] == "parameter" and location.split(":")[-1] != truth["location"].split(":")[-1])
    return False


def place_is_right(location: str, truth: dict[str, Any]) -> tuple[bool, bool]:
    """(channel, place): the part after the colon, such as 2X, and the part before it, such as actuator."""
    place, _, channel = location.partition(":")
    options = [one.partition(":")[::2] for one in truth["location"].split("|")]
    own = [c for _, c in options]
    channel_right = "all" in own or channel in own or location.endswith((":force_constant", ":stiffness"))
    return channel_right, place in {p for p, _ in options} | set(ALSO_AT.get(truth["name"], ()))
