"""What a law needs of a machine, and which laws a machine makes commoner: one row a law, each with its reason.

A law that a machine cannot have is not offered as a hypothesis; one that a fault gives it is offered as rare. A part that is not known
refuses nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from ctrlgen.devices.machine import MachineParts
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.law_prior import ONE_IN_A_HUNDRED

_CLEARANCE = frozenset({"gear", "harmonic drive", "screw", "belt", "rack", "cable", "linkage"})
_PERIODIC_SENSORS = frozenset({"interferometer", "encoder", "resolver"})
_PERIODIC_PARTS = frozenset({"gear", "harmonic drive", "screw", "belt", "rack"})
_PERIODIC_ACTUATORS = frozenset({"stepper", "servo motor", "servo", "linear motor", "piezo motor"})


@dataclass(frozen=True)
class LawNeeds:
    """What a law needs: of each row that is not empty one part. `any_part`: one part of any row is enough.

    families: of actuators (`ctrlgen.devices.machine.FAMILIES`). actuators, transmissions, sensors: by the names of `[machine]`.
    by_fault: a fault gives it to a machine that was built without, as a screw that works loose does: the law is offered, and rare.
    """

    what: str
    families: frozenset[str] = frozenset()
    actuators: frozenset[str] = frozenset()
    transmissions: frozenset[str] = frozenset()
    sensors: frozenset[str] = frozenset()
    by_fault: bool = False

    def missing(self, parts: MachineParts) -> str:
        """Why a machine of these parts cannot have the law; empty where it may."""
        if self.families and (why := parts.cannot_be(self.families)):
            return f"{self.what}, and {why}"
        rows: list[tuple[frozenset[str], frozenset[str] | None]] = [
            (self.actuators, None if parts.actuator is None else frozenset({parts.actuator})),
            (self.transmissions, None if parts.transmission is None else frozenset(parts.transmission)),
            (self.sensors, None if parts.sensor is None else frozenset({parts.sensor})),
        ]
        wanted = [(names, stated) for names, stated in rows if names]
        if wanted and all(stated is not None and not names & stated for names, stated in wanted):
            return f"{self.what}, and it has none"
        return ""


_CYCLIC = ("cyclic", "cyclic_from_home")
_HEATER = LawNeeds("it needs a heater", families=frozenset({"thermal"}))

NEEDS: Mapping[str, LawNeeds] = MappingProxyType(
    {
        # Strain by the square of a polarisation that switches: G. Bertotti, I. Mayergoyz, The Science of Hysteresis, vol. 3 (2006)
        "butterfly": LawNeeds("it needs a ferroelectric", families=frozenset({"piezo"})),
        # Ferroelectrics, and the iron of a motor; air, a fluid and a heater have none
        "drive_hysteresis": LawNeeds(
            "it needs a ferroelectric or iron", families=frozenset({"piezo", "electromagnetic"})
        ),
        "asymmetric_drive_hysteresis": LawNeeds(
            "it needs a ferroelectric or iron", families=frozenset({"piezo", "electromagnetic"})
        ),
        # Slots, magnets and threads; a coil in an even gap and a stack on flexures have none
        **dict.fromkeys(
            ("cogging", "cogging_from_home", "cogging_of_slots"),
            LawNeeds(
                "it needs a motor with poles or a part with a pitch",
                actuators=_PERIODIC_ACTUATORS,
                transmissions=_PERIODIC_PARTS,
            ),
        ),
        # The field of a gap that a coil or an armature leaves; a ceramic has none
        "force_factor": LawNeeds("it needs a coil or an armature", families=frozenset({"electromagnetic"})),
        # A stack takes no power to speak of, and a heater has laws of its own
        **dict.fromkeys(
            ("back_emf", "coil_heating"), LawNeeds("it needs a coil", families=frozenset({"electromagnetic"}))
        ),
        "heater_resistance": _HEATER,
        "heater_resistance_of_second_order": _HEATER,
        "heat_loss": _HEATER,
        "heat_crosstalk": _HEATER,
        "second_pole": _HEATER,
        "expansion": _HEATER,
        "lost_beams": LawNeeds(
            "it needs beams or a winding that can break",
            families=frozenset({"thermal", "electromagnetic", "electrostatic"}),
        ),
        "backlash": LawNeeds("it needs a part with clearance", transmissions=_CLEARANCE, by_fault=True),
        **dict.fromkeys(
            ("backlash_above", "backlash_below", "worn_backlash"),
            LawNeeds("it needs a part with clearance", transmissions=_CLEARANCE),
        ),
        # What counts, or measures by a reference that lasts, keeps a constant; a stack that is driven by charge moves as it leaks
        "high_pass": LawNeeds(
            "it needs a sensor of charge, one coupled for alternating signals, or a ceramic that charge drives",
            actuators=frozenset({"piezo stack", "piezo ceramic"}),
            sensors=frozenset({"capacitive", "strain gauge", "load cell", "accelerometer"}),
        ),
        # What counts, or measures by a reference that lasts, has no curve; light, a field or a bridge has
        **dict.fromkeys(
            ("sensor_limit", "sensor_saturation"),
            LawNeeds(
                "it needs a sensor that measures by a level",
                sensors=frozenset(
                    {
                        *("capacitive", "eddy current", "LVDT", "potentiometer", "strain gauge", "load cell"),
                        *("tachometer", "autocollimator", "accelerometer"),
                    }
                ),
            ),
        ),
        **dict.fromkeys(
            _CYCLIC,
            LawNeeds(
                "it needs a sensor or a part that repeats",
                actuators=_PERIODIC_ACTUATORS,
                transmissions=_PERIODIC_PARTS,
                sensors=_PERIODIC_SENSORS,
            ),
        ),
    }
)


def not_offered(laws: Sequence[str], parts: MachineParts) -> dict[str, str]:
    """Those of the `laws` that a machine of these parts cannot have, each with the reason."""
    return {law: why for law, why in _lacking(laws, parts).items() if not NEEDS[law].by_fault}


def offered_as_faults(laws: Sequence[str], parts: MachineParts) -> dict[str, str]:
    """Those of the `laws` that a machine of these parts has by a fault alone, each with the reason; they are offered as rare."""
    return {law: why for law, why in _lacking(laws, parts).items() if NEEDS[law].by_fault}


def _lacking(laws: Sequence[str], parts: MachineParts) -> dict[str, str]:
    return {law: why for law in laws if law in NEEDS and (why := NEEDS[law].missing(parts))}


THREE_TO_ONE = 1.1  # ln 3: weak, so that a gain of two in chi-square outweighs it; judgement


@dataclass(frozen=True)
class Usual:
    """What is usual in a machine with a part: laws that are commoner there, how large they are, and who says so."""

    part: str
    laws: frozenset[str]
    text: str


USUAL: Sequence[Usual] = (
    Usual(
        "piezo",
        frozenset(
            {
                "drive_hysteresis",
                "displacement_hysteresis",
                "asymmetric_drive_hysteresis",
                "asymmetric_displacement_hysteresis",
                "weighted_displacement_hysteresis",
                "weighted_drive_hysteresis",
            }
        ),
        "a piezo without a sensor of its own lags by 2 % of a small and 10 to 15 % of a full motion (Physik Instrumente, piezo tutorial)",
    ),
    Usual(
        "piezo",
        frozenset({"log_creep"}),
        "a piezo creeps by 1 to 2 % of a step in each decade of time (Physik Instrumente, piezo tutorial)",
    ),
    Usual(
        "harmonic drive",
        frozenset(_CYCLIC),
        "a harmonic drive errs twice a turn of its wave generator (T. D. Tuttle, MIT AI Laboratory, TR 1365, 1992)",
    ),
    Usual(
        "resolver",
        frozenset(_CYCLIC),
        "a resolver errs once and twice an electrical turn (D. C. Hanselman, IEEE Trans. Ind. Electron. 37 (1990) 556)",
    ),
    Usual(
        "capacitive",
        frozenset({"low_pass", "delay"}),
        "a capacitive sensor is read through the low-pass of its demodulator (A. J. Fleming, Sens. Actuators A 190 (2013) 106)",
    ),
    Usual(
        "interferometer",
        frozenset(_CYCLIC),
        "an interferometer errs once and twice a fringe (P. L. M. Heydemann, Appl. Opt. 20 (1981) 3382)",
    ),
)


def usual(parts: MachineParts) -> list[Usual]:
    """What is usual in a machine of these parts."""
    return [row for row in USUAL if row.part in parts.words]


def with_odds(hypothesis: Hypothesis, parts: MachineParts) -> Hypothesis:
    """The hypothesis with the log odds that its law has in a machine of these parts beside those of the law itself."""
    if offered_as_faults([hypothesis.effect], parts):
        return replace(hypothesis, machine_odds=ONE_IN_A_HUNDRED)
    commoner = any(hypothesis.effect in row.laws for row in usual(parts))
    return replace(hypothesis, machine_odds=THREE_TO_ONE) if commoner else hypothesis


def refusals(refused: Mapping[str, str]) -> list[str]:
    """Refused laws, those of one reason together: 'butterfly: it needs a ferroelectric, and its actuator is a stepper'."""
    by_reason: dict[str, list[str]] = {}
    for law, why in refused.items():
        by_reason.setdefault(why, []).append(law)
    return [f"{', '.join(laws)}: {why}" for why, laws in by_reason.items()]
