"""What is asked of a device of each kind, with an answer to begin with; a template beside this file turns the answers into a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import parse, to_si, written_unit


@dataclass(frozen=True)
class Question:
    """One number of a device: its `key`, the question in words, and an `answer` to begin with; another has its dimension, or that of one of
    the units `or_in`, and is above zero, unless it `may_be_zero`."""

    key: str
    text: str
    answer: str
    or_in: tuple[str, ...] = ()
    may_be_zero: bool = False


@dataclass(frozen=True)
class Kind:
    """A kind of device that can be begun: what it is, its questions."""

    title: str
    questions: tuple[Question, ...]


STACK = (
    Question("voltage", "largest voltage of the amplifier", "120 V"),
    Question("free_stroke", "stroke of the stack at that voltage, free", "20 um"),
    Question("stack_stiffness", "stiffness of the stack", "50 N/um"),
)
BLADES = (
    Question("blade_length", "length of a blade (leaf spring)", "25 mm"),
    Question("blade_thickness", "thickness of a blade, along which it bends", "0.5 mm"),
    Question("blade_width", "width of a blade", "10 mm"),
)
KINDS: Mapping[str, Kind] = {
    "piezo": Kind(
        "one axis: a piezo stack pushes a stage on two blades",
        (*STACK, Question("mass", "moving mass", "50 g"), *BLADES),
    ),
    "voice-coil": Kind(
        "one axis with inertia: a voice coil moves a mass on flexures",
        (
            Question("mass", "moving mass", "0.5 kg"),
            Question("stiffness", "stiffness of the flexures", "0.2 N/um"),
            Question("damping", "viscous damping, from a ring-down", "30 N*s/m"),
            Question("stroke", "largest displacement to either side", "100 um"),
            Question("force_constant", "force of the coil per volt or ampere", "10 N/V", ("N/A",)),
            Question("drive_limit", "largest drive of either sign, in the same volt or ampere", "4 V", ("A",)),
        ),
    ),
    "xy": Kind(
        "X-Y stage: two piezo stacks, each pushing a block, blades decouple the plate",
        (*STACK, Question("mass", "mass of the plate", "0.25 kg"), *BLADES),
    ),
    "tip-tilt": Kind(
        "mirror on three piezo stacks: tip, tilt and piston",
        (*STACK, Question("radius", "radius of the circle on which the stacks stand", "12 mm")),
    ),
    "hexapod": Kind(
        "six struts on three planar stages, moved by six linear actuators: kinematics alone",
        (
            Question("platform_radius", "radius of the strut ends on the platform", "60 mm"),
            Question("base_radius", "radius of the strut ends on the stages", "140 mm"),
            Question("platform_half_angle", "half the angle between neighbouring strut ends on the platform", "10 deg"),
            Question("base_half_angle", "half the angle between neighbouring strut ends on the base", "5 deg"),
            Question("height", "height of the platform's centre above the lower strut ends", "200 mm"),
            Question("platform_thickness", "thickness of the platform", "12 mm"),
            Question("travel", "largest displacement of an actuator to either side", "1 mm"),
        ),
    ),
    "servo": Kind(
        "one axis that goes where it is told, or nearly",
        (Question("travel", "largest excursion to either side, a length or an angle", "10 mm", ("deg",)),),
    ),
    "tested-axis": Kind(
        "one axis that a machine moves while its force is read",
        (
            Question("mass", "what is accelerated with the motion, a mass or an inertia", "1 kg", ("kg*m^2",), True),
            Question("damping", "viscous damping", "10 N*s/m", ("N*m*s/rad",), True),
            Question("stiffness", "stiffness", "1 N/mm", ("N*m/rad",), True),
            Question("stroke", "largest displacement to either side, a length or an angle", "10 mm", ("rad",)),
            Question("speed", "largest speed, to a digit", "100 mm/s", ("rad/s",)),
            Question("force", "largest force or torque, to a digit", "100 N", ("N*m",)),
        ),
    ),
    "mechanism": Kind(
        "a mechanism of your own, from its drawing: bodies, blades, actuators, readings",
        (
            Question("mass", "mass of the moving body", "35 g"),
            *BLADES,
            Question("force_constant", "force of the actuator per ampere", "3.8 N/A"),
            Question("drive_limit", "largest current of either sign", "1.5 A"),
        ),
    ),
    "matrix": Kind(
        "a stage by its compliance at a point, measured or from finite elements; or by its stiffness, or its Jacobian",
        (
            Question("compliance_x", "displacement along x per force along x", "20 um/N"),
            Question("compliance_y", "displacement along y per force along y", "0.5 um/N"),
            Question("compliance_z", "rotation about z per moment about z", "5 mrad/(N*m)"),
            Question("gain", "force of the actuator per ampere", "3.8 N/A"),
            Question("drive_limit", "largest current of either sign", "1.5 A"),
            Question("travel", "largest displacement to either side", "100 um"),
        ),
    ),
}


@dataclass(frozen=True)
class Answer:
    """An answer as it is written, in SI, and whether it was `given` or is the one to begin with."""

    text: str
    si: float
    given: bool


def answers(kind: str, given: Mapping[str, str]) -> dict[str, Answer]:
    """The answer to every question of a kind, those `given` and the rest as assumed.

    Raises InputError for a key that the kind does not ask for, and for a number of another dimension or not above zero.
    """
    questions = {question.key: question for question in KINDS[kind].questions}
    faults = [
        Fault(f"--set {key}", f"is not asked of {kind}; asked are {', '.join(questions)}")
        for key in given
        if key not in questions
    ]
    answered = {}
    for key, question in questions.items():
        text = given.get(key, question.answer).strip()
        try:
            answered[key] = Answer(text, read(question, text), key in given)
        except ValueError as error:
            faults.append(Fault(f"--set {key}", str(error)))
    if faults:
        raise InputError("new device", faults)
    return answered


def read(question: Question, text: str) -> float:
    """The SI number of an answer. Raises ValueError that says what to write instead."""
    faults = []
    for wanted in (written_unit(question.answer), *question.or_in):
        try:
            si = parse(text, wanted)
        except ValueError as error:
            faults.append(error)
            continue
        if not (si > to_si(0.0, wanted) or (question.may_be_zero and si == to_si(0.0, wanted))):
            raise ValueError(f"{text!r} must be above zero")
        return si
    raise faults[0]
