"""Words of the field for the parts of a machine, and the name by which a device file knows each part."""

from __future__ import annotations

from collections.abc import Mapping
from typing import get_args

OTHER_WORDS: Mapping[str, tuple[str, ...]] = {
    # actuators
    "voice coil": (
        "voice-coil motor",
        "voice coil actuator",
        "VCM",
        "moving coil",
        "Lorentz actuator",
        "Lorentz motor",
    ),
    "linear motor": ("ironless linear motor", "iron-core linear motor", "linear servo motor", "planar motor"),
    "servo motor": ("DC motor", "brushed motor", "brushless motor", "BLDC motor", "AC servo motor", "torque motor"),
    "stepper": ("stepper motor", "stepping motor", "step motor"),
    "galvanometer": ("galvo", "galvanometer scanner"),
    "solenoid": ("reluctance actuator", "electromagnet"),
    "piezo stack": ("piezo", "piezo actuator", "piezoelectric actuator", "piezoelectric stack", "stack", "PZT stack"),
    "piezo ceramic": ("piezoelectric ceramic", "PZT", "piezo tube", "bimorph", "piezo bender"),
    "piezo motor": ("piezo walker", "inertia drive", "stick-slip drive", "ultrasonic motor", "inchworm"),
    "thermal": (
        "thermal actuator",
        "heater",
        "chevron",
        "bent-beam actuator",
        "electrothermal",
        "electrothermal actuator",
    ),
    "electrostatic": ("comb drive", "electrostatic actuator"),
    "hydraulic": ("hydraulic cylinder", "hydraulic actuator"),
    "pneumatic": ("pneumatic cylinder", "air cylinder", "bellows", "pneumatic actuator"),
    "pump": ("syringe pump",),
    # what stands between
    "none": ("direct", "direct drive", "rigid"),
    "flexure": ("flexures", "flexure hinge", "leaf spring", "blade", "notch hinge", "flexure guide"),
    "lever": ("levers", "bridge amplifier", "lever amplifier", "displacement amplifier"),
    "linkage": ("hinges", "joints", "four-bar linkage", "crank"),
    "screw": ("ball screw", "lead screw", "roller screw", "spindle", "threaded rod", "micrometer"),
    "gear": ("gearbox", "gear train", "worm gear", "planetary gear", "spur gear", "gears"),
    "harmonic drive": ("strain wave gear", "harmonic gear"),
    "belt": ("timing belt", "toothed belt", "belt drive"),
    "rack": ("rack and pinion", "rack-and-pinion", "pinion"),
    "cable": ("cable drive", "wire rope", "tendon", "capstan drive", "capstan"),
    # sensors
    "capacitive": ("capacitive sensor", "capacitive probe", "capacitance gauge", "capacitive gauge"),
    "eddy current": ("eddy current sensor", "eddy current probe", "inductive sensor"),
    "LVDT": ("differential transformer", "linear variable differential transformer"),
    "interferometer": ("laser interferometer", "fibre interferometer", "fiber interferometer", "vibrometer"),
    "encoder": (
        "linear scale",
        "optical scale",
        "glass scale",
        "linear encoder",
        "optical encoder",
        "rotary encoder",
        "incremental encoder",
        "scale",
    ),
    "resolver": ("inductosyn",),
    "potentiometer": ("linear potentiometer",),
    "strain gauge": ("strain gage", "strain gauges", "strain gages", "strain sensor"),
    "load cell": ("force sensor", "force transducer", "torque sensor", "torque transducer"),
    "tachometer": ("tacho", "speed sensor"),
    "camera": ("vision", "machine vision", "microscope", "video"),
    "autocollimator": ("electronic autocollimator",),
    "laser triangulation": (
        "triangulation sensor",
        "laser displacement sensor",
        "laser distance sensor",
        "confocal sensor",
        "chromatic confocal sensor",
    ),
    "accelerometer": ("acceleration sensor", "accelerometers"),
}
"""By the name of a part what else it is called; a word stands in one list."""


def _plain(word: str) -> str:
    return " ".join(word.replace("-", " ").replace("_", " ").casefold().split())


_NAMES = {_plain(word): name for name, words in OTHER_WORDS.items() for word in (name, *words)}


def name_of_part(word: object, names: object) -> object:
    """The one of the `names` (a Literal) that a word of the field means, whatever its case and hyphens; the word itself where it is none,
    or a part of another kind."""
    if not isinstance(word, str):
        return word
    meant = _NAMES.get(_plain(word), word)
    return meant if meant in get_args(names) else word
