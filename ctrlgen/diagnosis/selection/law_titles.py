"""What a law is called in sentences about a machine: in the words of its parts, or in neutral ones where they are not known.

The title of a law's own file says what it is published for; a sentence about a pump must not speak of ferroelectrics.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from ctrlgen.devices.machine import MachineParts
from ctrlgen.effects import Effect

ONE_WAY = "one way"  # axes whose motion is imposed go one way alone in the records

# By law: (word of the machine, title) in the order in which they are looked for; "" is for any other machine. A word is a family of
# actuators, the name of a part, "position" for a drive that is a position, "flexible" for a stage on flexures, "imposed" for a
# motion, or ONE_WAY.
TITLES: Mapping[str, tuple[tuple[str, str], ...]] = MappingProxyType(
    {
        "amplifier_lag": (
            ("position", "An axis that follows its command late: a controller of limited bandwidth"),
            *((word, "An amplifier of limited bandwidth") for word in ("piezo", "electromagnetic")),
            ("", "A drive that follows its command late: limited bandwidth"),
        ),
        "asymmetric_gain": (
            ("position", "An axis that goes farther to one side than to the other"),
            ("electromagnetic", "An amplifier, or motor, that is stronger in one direction"),
            ("", "A drive that is stronger in one direction"),
        ),
        "asymmetric_displacement_hysteresis": (
            ("piezo", "Asymmetric hysteresis of the piezo, or of a joint behind it"),
        ),
        "asymmetric_drive_hysteresis": (
            ("piezo", "Asymmetric hysteresis of the piezo: the displacement lags behind the voltage"),
            ("electromagnetic", "Asymmetric hysteresis of the motor's iron: the force lags behind the current"),
            ("", "Asymmetric hysteresis of the actuator: its force lags behind the drive"),
        ),
        "asymmetric_slew_rate": (
            (
                "position",
                "An axis that follows its command faster in one direction, and no faster than at a speed of each",
            ),
            ("", "A drive that follows its command at most so fast, up faster than down or down faster than up"),
        ),
        "butterfly": (
            ("piezo", "Strain of a ferroelectric: it grows with the square of a polarisation that remembers"),
            ("", "A drive that acts by the square of a state that remembers"),
        ),
        "cogging": (
            ("screw", "A force that repeats along the way: cogging of the motor, or ripple of the screw"),
            ("electromagnetic", "A force that repeats along the way: cogging of the motor"),
            ("", "A force that repeats along the way"),
        ),
        "cogging_from_home": (
            (
                "electromagnetic",
                "A force that repeats along the way, read from where the stage rests: cogging of the motor",
            ),
            ("", "A force that repeats along the way, of a stage whose reading is zero where it rests"),
        ),
        "cogging_of_slots": (
            (
                "screw",
                "A force that repeats along the way, not as a sine: cogging of the motor, or ripple of the screw",
            ),
            ("electromagnetic", "A force that repeats along the way, not as a sine: cogging of the motor"),
            ("", "A force that repeats along the way, not as a sine"),
        ),
        "creep": (
            ("flexible", "A flexure or its glue keeps moving after the load has settled"),
            ("piezo", "A piezo, or its mount, keeps moving after the voltage has settled"),
            ("", "A displacement that goes on after the drive has settled"),
        ),
        "cubic_drive": (
            ("electromagnetic", "A drive whose gain falls, or rises, with its size: iron that saturates"),
            ("", "A drive whose gain falls, or rises, with its size"),
        ),
        "dead_zone": (
            ("position", "An axis that ignores small commands"),
            *(
                (word, "A valve, or what drives it, that ignores small drives: overlap")
                for word in ("hydraulic", "pneumatic")
            ),
        ),
        "delay": (("", "A fixed time between drive and reading: the reading, or the drive, is late"),),
        "displacement_hysteresis": (
            ("cable", "Hysteresis of the cable: the joint lags"),
            ("piezo", "Hysteresis of the piezo, or of a joint behind it: the displacement lags"),
        ),
        "drive_crosstalk": (("", "What is asked of one actuator acts at another one too"),),
        "drive_gain": (
            ("position", "An axis that goes farther, or less far, than it is told"),
            ("", "A drive that does more, or less, than it is told"),
        ),
        "drive_hysteresis": (
            ("piezo", "Hysteresis of the piezo: the displacement lags behind the voltage"),
            ("electromagnetic", "Hysteresis of the motor's iron: the force lags behind the current"),
            ("", "Hysteresis of the actuator: its force lags behind the drive"),
        ),
        "drive_offset": (
            ("position", "A command that is off by a constant"),
            ("thermal", "A heater that is heated when it is told nothing"),
            ("pump", "A pump that delivers something when it is told nothing"),
            ("piezo", "An amplifier that gives a voltage when it is told none"),
            (
                "electromagnetic",
                "An amplifier that drives the motor when it is told nothing, or a constant force such as a weight",
            ),
            ("", "A drive that is off by a constant, or a constant force such as a weight"),
        ),
        "eccentricity": (
            ("gear", "An error once a turn: a gear, or the sensor's graduation, whose centre is beside the axis"),
            ("", "An error once a turn: the sensor's graduation is centred beside the axis"),
        ),
        "high_pass": (
            (
                "piezo",
                "What stands still is forgotten: a charge amplifier that leaks, of the sensor or of the piezo that it drives",
            ),
        ),
        "home_offset": (
            (
                ONE_WAY,
                "A constant in the force or torque that is read: the zero of its sensor, a load such as a weight, or the dry friction "
                "of an axis that moves one way alone",
            ),
            (
                "imposed",
                "A constant in the force or torque that is read: the zero of its sensor, or a load such as a weight",
            ),
        ),
        "lever_ratio": (
            ("lever", "A lever whose arms are not as drawn"),
            ("flexible", "A lever whose arms are not as drawn"),
            ("", "Something behind the drive that goes farther, or less far, than the model says"),
        ),
        "lost_motion": (
            ("lever", "A lever that bends under the force it transmits"),
            ("flexible", "A lever that bends under the force it transmits"),
            ("", "Something behind the drive that yields under the force it transmits"),
        ),
        "lost_beams": (
            ("thermal", "Beams that break at one moment"),
            ("electromagnetic", "A winding that breaks at one moment"),
            ("", "A part of the actuator that fails at one moment"),
        ),
        "one_sided_saturation": (
            ("position", "An axis that stops short of its stated travel in one direction"),
            # a stage without inertia does not tell them apart
            ("", "A drive that saturates in one direction, or a stop that does not give"),
        ),
        "one_sided_stiffening": (
            ("flexible", "A flexure that is bent or loaded already at home: stiffer to one side than to the other"),
            ("", "A stiffness that is larger to one side than to the other"),
        ),
        "payload": (
            ("cable", "A weight on the joint whose moment stretches the cable"),
            ("belt", "A weight whose moment stretches the belt"),
            ("gear", "A weight, or an unbalanced mass, whose moment twists the gear"),
            ("harmonic drive", "A weight, or an unbalanced mass, whose moment twists the harmonic drive"),
            ("flexible", "A weight on the platform, whose moment bends the flexures"),
            ("", "A weight, or an unbalanced mass, whose moment bends what carries it"),
        ),
        "notch": (
            ("piezo", "A notch in the drive: a filter of the controller or of the amplifier"),
            ("", "A notch in the drive: a filter of the controller"),
        ),
        "reversed": (("position", "An axis that counts the other way round"),),
        "saturation": (
            ("position", "An axis that stops short of its stated travel"),
            ("", "A drive that saturates below its stated limit"),
        ),
        "slew_rate": (
            ("position", "An axis that follows its command no faster than at one speed"),
            *(
                (word, "An amplifier whose output changes at most so fast: slew rate")
                for word in ("piezo", "electromagnetic")
            ),
            ("", "A drive that follows its command no faster than at one rate: slew rate"),
        ),
        "soft_saturation": (
            ("position", "An axis that goes less far the farther it is told, toward a limit"),
            (
                "electromagnetic",
                "A drive that levels off toward a limit: an amplifier, or iron, that saturates smoothly",
            ),
        ),
        "stiffening": (
            ("flexible", "A clamped flexure stretches as it bends"),
            ("", "A stiffness that grows with the square of the displacement"),
        ),
        "thermal_lag": (
            ("thermal", "A share of the actuator's action that builds up slowly, as heat spreads through a body"),
            ("", "A share of the drive's action that builds up slowly"),
        ),
        "weighted_displacement_hysteresis": (
            ("cable", "Hysteresis of the cable: the joint lags"),
            ("piezo", "Hysteresis of the piezo, or of a joint behind it: the displacement lags"),
            ("", "Hysteresis of a joint or guide between stage and mechanism: the displacement lags"),
        ),
        "weighted_drive_hysteresis": (
            ("piezo", "Hysteresis of the piezo: the displacement lags behind the voltage"),
            ("electromagnetic", "Hysteresis of the motor's iron: the force lags behind the current"),
            ("", "Hysteresis of the actuator: its force lags behind the drive"),
        ),
        "zero_per_record": (
            (
                "",
                "Another constant in each record: a sensor that is zeroed anew, or a force, such as a weight, that changed between them",
            ),
        ),
    }
)


# What repeats along the way, and what has clearance, by the name of the part that does
REPEATS: Mapping[str, str] = MappingProxyType(
    {
        "screw": "the screw's pitch",
        "harmonic drive": "the harmonic drive (two a turn of its wave generator)",
        "gear": "the teeth of the gear",
        "belt": "the teeth of the belt",
        "rack": "the teeth of the rack",
        "stepper": "the steps of the motor",
        "piezo motor": "the steps of the motor",
        "interferometer": "the interferometer's fringe",
        "resolver": "the resolver's period",
        "encoder": "the encoder's pitch",
    }
)
CLEARANCE: Mapping[str, str] = MappingProxyType(
    {
        "gear": "the gear",
        "harmonic drive": "the harmonic drive",
        "screw": "the nut",
        "belt": "the belt",
        "rack": "the rack",
        "cable": "the cable",
        "linkage": "the joints",
    }
)


def title(law: type[Effect], parts: MachineParts, one_way: bool = False) -> str:
    """The title of a law on a machine of these parts, in records in which its axes move `one_way` alone or not."""
    words = parts.words | {""} | ({ONE_WAY} if one_way else frozenset())
    if law.kind in ("cyclic", "cyclic_from_home") and (those := _any_of(REPEATS, words)):
        # where a sensor alone is stated, what stands behind it is not known
        more = "" if words & REPEATS.keys() - {parts.sensor} or parts.transmission else ", or a pitch behind it"
        home = ", read as zero at home" if law.kind == "cyclic_from_home" else ""
        return f"An error that repeats along the path: {those}{more}{home}"
    if law.kind == "backlash" and (those := _any_of(CLEARANCE, words)):
        return f"{'Slack' if those == CLEARANCE['cable'] else 'Play'} in {those}"
    if law.kind == "backlash" and parts.transmission:
        return "Play where this machine has no part with clearance: something is loose"
    return next((text for word, text in TITLES.get(law.kind, ()) if word in words), law.title)


def _any_of(texts: Mapping[str, str], words: frozenset[str]) -> str:
    """Those of the texts whose part is among the words, joined by 'or'."""
    return " or ".join(dict.fromkeys(text for word, text in texts.items() if word in words))
