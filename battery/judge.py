"""Compares one diagnosis with one answer: which names, which places, which intervals. The table of accepted names is here."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from battery.laws_drive import ARRIVING, BREAKING

# Truth -> names that are right. Two names stand together where the physics is one law under two names, or where moving a
# linear law along the chain changes nothing that a recording could show (a lag in the actuator, a relaxation in the flexure).
FORCE_CONSTANT = "parameter@force_constant"
ACCEPTED: dict[str, tuple[str, ...]] = {
    "softening": ("stiffening",),
    "hysteresis": ("hysteresis", "bouc_wen"),
    "creep": ("creep", "log_creep", "thermal_lag", "second_pole"),
    "log_creep": ("log_creep", "creep"),
    "thermal_lag": ("thermal_lag", "second_pole", "creep"),
    "viscous": ("viscous", "asymmetric_viscous"),
    "step": ("step", "force_step"),
    "frame_turn": ("frame_turn", "frame_rotation_z"),
    "low_pass": ("low_pass", "thermal_lag"),
    "coulomb": ("coulomb",),
    "stribeck": ("stribeck",),
    "drive_gain": ("drive_gain", "sensor_gain", FORCE_CONSTANT),
    "sensor_gain": ("sensor_gain", "drive_gain", FORCE_CONSTANT),
    "stiffness": ("stiffness", "parameter@stiffness"),
    "finite_rotation": ("finite_rotation",),
}
SAME_LAW = {
    "step": "force_step",
    "frame_turn": "frame_rotation_z",
}  # truth -> another name of the very same law and numbers
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
    "step": {("amplitude", "size", "height", "force"): lambda t: t["amplitude"], ("moment", "time"): lambda t: _middle(t, ARRIVING)},
    "lost_beams": {("share", "fraction", "lost"): lambda t: t["amplitude"], ("moment", "time"): lambda t: _middle(t, BREAKING)},
    "resonance": {("frequency",): lambda t: t["shape"]["frequency"]},
    "heat_crosstalk": {("share",): lambda t: t["amplitude"]},
    "frame_turn": {("angle",): lambda t: t["amplitude"]},
}  # fmt: skip
BASE = {"": 1.0, "1": 1.0, "%": 1e-2, "m": 1.0, "s": 1.0, "Hz": 1.0, "N": 1.0, "V": 1.0, "A": 1.0, "W": 1.0, "K": 1.0, "kg": 1.0,
        "g": 1e-3, "rad": 1.0, "deg": math.pi / 180, "degC": 1.0, "min": 60.0, "ohm": 1.0, "Pa": 1.0}  # fmt: skip
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
    """Whether the name of a finding is right for a planted law."""
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


@dataclass
class Judgement:
    """One case. `named`: (truth, name given or 'none'); `covered`: (name, parameter, inside); `places`: (channel, place) right;
    `bands`: whether a line's frequency lies in the band with the largest excess."""

    case: str
    kind: str
    verdict: str
    exact: bool = False
    in_set: bool = False
    wrong: bool = False
    alarmed: bool = False
    abstained: bool = False
    admitted: bool = False
    named: list[tuple[str, str]] = field(default_factory=list)
    places: list[tuple[bool, bool]] = field(default_factory=list)
    bands: list[bool] = field(default_factory=list)
    covered: list[tuple[str, str, bool]] = field(default_factory=list)
    ratio: float | None = None
    seconds: float | None = None
    autocorrelated: bool = False


def _covered(finding: dict[str, Any], truth: dict[str, Any]) -> list[tuple[str, str, bool]]:
    if finding["effect"] not in {truth["name"], SAME_LAW.get(truth["name"])}:
        return []
    out = []
    given = finding.get("parameters", {})
    for aliases, value in TRUTHS.get(truth["name"], {}).items():
        name = next((n for n in aliases if n in given), None)
        interval = given[name].get("ci95") if name else None
        if not interval or any(end is None for end in interval):
            continue
        low, high = (in_si(float(end), given[name].get("unit") or "") for end in interval)
        out.append((truth["name"], str(name), low <= value(truth) <= high))
    return out


def judge(answer: dict[str, Any], diagnosis: dict[str, Any] | None, seconds: float | None = None) -> Judgement:
    """A diagnosis that is missing (crash, time-out) is wrong in every count, and on clean data a false alarm."""
    truths = answer["planted"]
    j = Judgement(answer["case"], answer["class"], "failed", seconds=seconds)
    j.autocorrelated = answer.get("noise", {}).get("phi", 0) > 0
    if diagnosis is None:
        j.alarmed, j.named = True, [(t["name"], "failed") for t in truths]
        return j
    j.verdict = diagnosis["verdict"]
    findings = list(diagnosis.get("findings", []))
    j.alarmed = bool(findings) or j.verdict != "consistent"
    j.abstained = j.verdict == "unexplained"
    left, exact, near = list(findings), 0, 0
    for truth in truths:
        hit = next((f for f in left if is_right(f["effect"], f.get("location", ""), truth)), None)
        exact += hit is not None
        if hit is None:
            hit = next((f for f in left if _among(f, truth) and len(f["alternatives"]) == 1), None)
            near += hit is not None
        j.named.append((truth["name"], hit["effect"] if hit else "none"))
        if hit:
            left.remove(hit)
            j.places.append(place_is_right(_location(hit, truth), truth))
            j.covered += _covered(hit, truth)
    if [t["name"] for t in truths] == ["vibration"]:  # other laws have no band of their own
        j.bands = [_in_band(diagnosis.get("residual_location", {}), truths[0]["shape"]["frequency"])]
    left = [f for f in left if not any(_harmonic(f, t) or _cubic(f, t) for t in truths)]
    spare = [f for f in left if not any(_among(f, t) for t in truths)]
    j.named += [("nothing", f["effect"]) for f in spare]
    j.wrong = bool(spare)
    j.exact = exact == len(truths) and not left
    j.in_set = exact + near == len(truths) and not left
    names = {f["effect"] for f in findings} | {a["effect"] for f in findings for a in f.get("alternatives", [])}
    j.admitted = (
        j.verdict == "ambiguous" and any(_among(f, t, own=True) for f in findings for t in truths) and len(names) > 1
    )
    ratios = [c["rms_after"] / c["noise_floor"] for c in diagnosis.get("held_out", {}).values() if c.get("noise_floor")]
    j.ratio = max(ratios) if ratios else None
    return j


def _among(finding: dict[str, Any], truth: dict[str, Any], own: bool = False) -> bool:
    """Whether an alternative of the finding is right (or, with `own`, the finding itself)."""
    rivals = [*finding.get("alternatives", []), *([finding] if own else [])]
    return any(is_right(r["effect"], r.get("location", ""), truth) for r in rivals)


def _in_band(location: dict[str, Any], frequency: float) -> bool:
    """Whether the band with the largest excess over the noise, before any correction, holds the frequency [Hz]."""
    bands = location.get("before", {}).get("by_frequency", [])
    largest = max(bands, key=lambda b: b["excess"] or 0.0, default={"low": math.inf, "high": -math.inf})
    return largest["low"] <= frequency <= largest["high"]


def _harmonic(finding: dict[str, Any], truth: dict[str, Any]) -> bool:
    """Whether a further finding is the second harmonic that the plant's cyclic error has too."""
    period = finding.get("parameters", {}).get("period")
    if finding["effect"] != truth["name"] or not truth.get("shape", {}).get("second") or period is None:
        return False
    half = truth["shape"]["period"] / 2
    return abs(in_si(float(period["value"]), period["unit"]) - half) < 0.01 * half


def _cubic(finding: dict[str, Any], truth: dict[str, Any]) -> bool:
    """Whether a further finding is the cubic part that the plant's bow has too, its interval over the planted one."""
    curvature, shape = finding.get("parameters", {}).get("curvature"), truth.get("shape", {})
    if (finding["effect"], truth["name"]) != ("cubic_sensor", "bow") or not shape.get("cubic") or curvature is None:
        return False
    planted = truth["amplitude"] * shape["cubic"] / shape["span"] ** 3
    low, high = (in_si(float(end), curvature["unit"]) for end in curvature["ci95"])
    return finding.get("location") == truth["location"] and low <= planted <= high


def _location(finding: dict[str, Any], truth: dict[str, Any]) -> str:
    """Where the finding, or the alternative of it that is right, stands."""
    for one in (finding, *finding.get("alternatives", [])):
        if is_right(one["effect"], one.get("location", ""), truth):
            return one.get("location", "")
    return finding.get("location", "")
