"""A machine is offered the laws that its parts can have, and they are named in its words."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from axis_records import AXIS, H, axis_fitter, record
from conftest import DEVICES, SCENARIOS

import ctrlgen
from ctrlgen import diagnose, load_device
from ctrlgen.app.check_files import check
from ctrlgen.core.errors import InputError
from ctrlgen.devices.machine import FAMILIES, ActuatorName, Machine, MachineParts, SensorName, TransmissionName
from ctrlgen.diagnosis.report.answer import sentence
from ctrlgen.diagnosis.selection.law_titles import ONE_WAY, TITLES, title
from ctrlgen.effects import Effect
from ctrlgen.estimation.hypothesis import Hypothesis, hypotheses, nominal_physics
from ctrlgen.estimation.law_needs import NEEDS, USUAL, not_offered, offered_as_faults, refusals, usual, with_odds
from ctrlgen.estimation.law_prior import ONE_IN_A_HUNDRED
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

NAMES = {*get_args(ActuatorName), *get_args(TransmissionName), *get_args(SensorName)}
WORDS = {*NAMES, *FAMILIES.values(), "position", "flexible", "imposed", ONE_WAY}
# What may only be said of a machine that has it
OWN_WORDS = {
    "piezo": "piezo|ferroelectric|polarisation",
    "thermal": "heater|heat |heated",
    "electromagnetic": "motor|winding|iron",
    "fluid": "pump",
}


def parts(**stated) -> MachineParts:
    return MachineParts(**stated, family=FAMILIES.get(stated.get("actuator")))


def parts_of(path: str, **stated) -> MachineParts:
    device = load_device(path)
    if stated:
        device = device.model_copy(update={"machine": Machine(**stated)})
    return device.parts(nominal_physics(device))


def test_the_tables_name_laws_and_parts_that_exist():
    named = {*NEEDS, *TITLES, *(law for row in USUAL for law in row.laws)}
    assert named <= set(Effect.library)
    for needs in NEEDS.values():
        assert needs.families <= set(FAMILIES.values())
        assert needs.actuators | needs.transmissions | needs.sensors <= NAMES
    assert {word for rows in TITLES.values() for word, _ in rows} <= {*WORDS, ""}
    assert {row.part for row in USUAL} <= WORDS
    assert set(FAMILIES) == set(get_args(ActuatorName))
    for row in USUAL:
        assert re.search(r"\(.+\)$", row.text), "who says so"


@pytest.mark.parametrize("actuator", ["voice coil", "piezo stack", "thermal", "stepper", "servo"])
def test_the_usual_words_for_an_actuator_are_known(actuator):
    assert Machine(actuator=actuator).actuator in FAMILIES
    # a motor by either of its names has the same laws
    assert (
        not_offered(list(Effect.library), parts(actuator="servo")).keys()
        == not_offered(list(Effect.library), parts(actuator="servo motor")).keys()
    )


@pytest.mark.parametrize("actuator", get_args(ActuatorName))
def test_no_machine_is_told_of_parts_of_another(actuator):
    machine = parts(actuator=actuator)
    refused = not_offered(list(Effect.library), machine)
    for name, law in Effect.library.items():
        for family, words in OWN_WORDS.items():
            drives = law.place.value in ("drive", "heat")
            if name not in refused and drives and family != machine.family:
                assert not re.search(words, title(law, machine)), (name, title(law, machine))


def test_a_machine_of_unknown_parts_is_told_in_neutral_words():
    for name in (
        "drive_offset",
        "butterfly",
        "drive_hysteresis",
        "drive_gain",
        "cubic_drive",
        "square_drive",
        "amplifier_lag",
        "one_sided_saturation",
        "slew_rate",
        "asymmetric_slew_rate",
        "saturation",
        "stiffening",
        "creep",
        "cogging",
    ):
        said = title(Effect.library[name], MachineParts())
        assert not re.search("amplifier|flexure|" + "|".join(OWN_WORDS.values()), said), said
    assert title(Effect.library["lever_ratio"], MachineParts()).startswith("Something behind the drive")
    assert "fringe" in title(Effect.library["cyclic"], parts(sensor="interferometer"))
    assert "told nothing" in title(Effect.library["drive_offset"], parts(actuator="pump"))
    assert "command" in title(Effect.library["drive_offset"], MachineParts(position=True))


def test_a_constant_of_a_force_that_is_read_may_be_a_weight():
    device = load_device(SCENARIOS / "emps" / "device.toml")
    assert "such as a weight" in title(Effect.library["home_offset"], device.parts(nominal_physics(device)))
    assert "weight" not in title(Effect.library["home_offset"], MachineParts(transmission=("none",)))


def test_a_piezo_may_be_driven_by_a_charge_that_leaks():
    leak, interferometer = Effect.library["high_pass"], {"sensor": "interferometer"}
    assert "of the piezo that it drives" in title(leak, parts(actuator="piezo stack"))
    assert "piezo" not in title(leak, parts(actuator="voice coil"))
    assert not not_offered(["high_pass"], parts(actuator="piezo stack", **interferometer))
    assert "high_pass" in not_offered(["high_pass"], parts(actuator="voice coil", **interferometer))


def test_what_repeats_or_has_clearance_is_named_by_every_part_that_may():
    cyclic, play, weight = (Effect.library[kind] for kind in ("cyclic", "backlash", "payload"))
    drive = parts(actuator="servo motor", transmission=("harmonic drive",), sensor="encoder")
    assert title(cyclic, drive).endswith(
        ": the harmonic drive (two a turn of its wave generator) or the encoder's pitch"
    )
    assert title(cyclic, parts(sensor="encoder")).endswith(": the encoder's pitch, or a pitch behind it")
    assert title(cyclic, parts(actuator="stepper", sensor="encoder")).endswith(
        ": the steps of the motor or the encoder's pitch"
    )
    assert title(play, drive) == "Play in the harmonic drive" and title(play, parts(sensor="encoder")) == play.title
    joint = parts(actuator="servo motor", transmission=("cable",))
    assert title(play, joint) == "Slack in the cable" and title(weight, joint).endswith("stretches the cable")
    assert not any("cable" in title(law, drive) or "gear" in title(law, joint) for law in (cyclic, play, weight))


def test_a_motor_is_no_ferroelectric_and_a_stack_has_no_heater():
    for actuator in ("voice coil", "servo motor", "stepper", "pump", "thermal"):
        assert "butterfly" in not_offered(["butterfly"], parts(actuator=actuator))
    assert not not_offered(["butterfly", "drive_hysteresis"], parts(actuator="piezo stack"))
    heaters = [
        "heater_resistance",
        "heater_resistance_of_second_order",
        "heat_loss",
        "heat_crosstalk",
        "second_pole",
        "expansion",
    ]
    assert list(not_offered(heaters, parts(actuator="piezo stack"))) == heaters
    assert not not_offered(heaters, parts(actuator="thermal"))


def test_what_is_not_known_refuses_nothing():
    assert not not_offered(list(Effect.library), MachineParts())
    # a capacitive sensor repeats nothing, but a screw may stand behind it, and a stepper has poles
    assert not not_offered(["cyclic"], parts(sensor="capacitive"))
    assert not not_offered(["cyclic"], parts(sensor="capacitive", transmission=("screw",), actuator="voice coil"))
    direct = parts(sensor="capacitive", transmission=("flexure",), actuator="voice coil")
    assert list(not_offered(["cyclic", "worn_backlash"], direct)) == ["cyclic", "worn_backlash"]
    assert refusals(not_offered(["butterfly"], direct)) == [
        "butterfly: it needs a ferroelectric, and its actuator is a voice coil"
    ]
    assert [
        line.split(":")[0] for line in refusals(not_offered(["backlash_above", "butterfly", "worn_backlash"], direct))
    ] == [
        "backlash_above, worn_backlash",
        "butterfly",
    ]


def test_play_is_offered_as_a_rare_fault_where_nothing_has_clearance():
    """A joint that should have none works loose; a machine with a gear, or of unknown parts, has play as any other law."""
    direct, geared = parts(transmission=("none",)), parts(transmission=("gear",))
    play, law = Hypothesis("backlash", "stage:axis", "axis"), Effect.library["backlash"]
    assert "backlash" not in not_offered(["backlash"], direct) and "backlash" in offered_as_faults(["backlash"], direct)
    assert with_odds(play, direct).machine_odds == ONE_IN_A_HUNDRED
    assert title(law, direct).endswith("something is loose")
    for known in (geared, MachineParts()):
        assert with_odds(play, known).machine_odds == 0 and not offered_as_faults(["backlash"], known)
        assert "loose" not in title(law, known)


def test_an_actuator_whose_name_is_an_adjective_has_no_article():
    assert parts(actuator="hydraulic").cannot_be(frozenset({"piezo"})) == "its actuator is hydraulic"
    assert parts(actuator="voice coil").cannot_be(frozenset({"piezo"})) == "its actuator is a voice coil"


def test_check_says_each_reason_on_a_line_of_its_own(tmp_path, capsys):
    machine = '[machine]\nactuator = "voice coil"\nsensor = "capacitive"\ntransmission = ["flexure"]\n'
    (tmp_path / "axis.toml").write_text((DEVICES / "flexure_axis.toml").read_text() + machine)
    check(tmp_path / "axis.toml")
    told = [line for line in capsys.readouterr().out.splitlines() if "not offered in a diagnosis:" in line]
    assert len(told) > 1 and all(line.count("it needs") == 1 for line in told)


def test_parts_are_inferred_from_kind_and_units():
    assert parts_of(DEVICES / "mems_hexapod.toml").family == "thermal"
    assert parts_of(DEVICES / "rrr_case1.toml").family == "piezo"
    assert parts_of(SCENARIOS / "emps" / "device.toml").family == "none"  # a test machine moves it
    assert parts_of(SCENARIOS / "rotary_axis" / "device.toml").position
    axis = parts_of(DEVICES / "flexure_axis.toml")
    assert axis.family is None and axis.flexible and not not_offered(["butterfly"], axis)
    assert parts_of(DEVICES / "flexure_axis.toml", actuator="voice coil").family == "electromagnetic"


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("N/V", "N/A", "4 V", "4 A"), "electromagnetic"),
        (('"0.2 N/um"', '"0 N/um"'), "nothing holds its stage"),
        (('stroke = "', 'stroke = "9000'), "its travel is beyond 2 mm"),
    ],
)
def test_an_axis_that_cannot_be_a_piezo_is_offered_no_strain_of_one(tmp_path, change, why):
    text = (DEVICES / "flexure_axis.toml").read_text()
    text = re.sub(r"stroke\s*= ", "stroke = ", text)
    for old, new in zip(change[::2], change[1::2], strict=True):
        assert old in text, text
        text = text.replace(old, new)
    (tmp_path / "axis.toml").write_text(text)
    assert why in not_offered(["butterfly"], parts_of(tmp_path / "axis.toml"))["butterfly"]


def test_a_part_that_nobody_knows_is_a_fault(tmp_path):
    text = (DEVICES / "flexure_axis.toml").read_text()
    (tmp_path / "axis.toml").write_text(text + '\n[machine]\nactuator = "voicecoil"\n')
    with pytest.raises(InputError) as error:
        load_device(tmp_path / "axis.toml")
    assert "machine.actuator" in str(error.value) and "voice coil" in str(error.value)
    (tmp_path / "axis.toml").write_text(text + '\n[machine]\ntransmission = ["belt", "screw"]\nsensor = "encoder"\n')
    assert load_device(tmp_path / "axis.toml").machine.transmission == ("belt", "screw")


def test_a_usual_law_is_commoner_and_told_with_its_source():
    stack = parts(actuator="piezo stack")
    assert any("10 to 15 %" in row.text for row in usual(stack)) and not usual(parts(actuator="voice coil"))
    here = Hypothesis("displacement_hysteresis", "stage:axis", "axis")
    there = with_odds(here, stack)
    assert there == here and there.machine_odds == pytest.approx(np.log(3), abs=0.01)
    assert with_odds(here, parts(actuator="stepper")).machine_odds == 0
    start = {"share": 0.1, "reach": 1e-5, "taper": 0.0, "reversible": 0.0}
    odds = [Structure(AXIS).with_cause(h, start).log_prior_odds for h in (here, there)]
    assert odds[1] - odds[0] == there.machine_odds


@pytest.mark.long
def test_a_diagnosis_names_what_it_finds_in_the_words_of_the_machine():
    fitter = axis_fitter(force=lambda t, q, v, memory: (0.5, memory), n=500)
    coil = AXIS.model_copy(update={"machine": Machine(actuator="voice coil", transmission="flexure")})
    found = diagnose(coil, fitter.recording, laws=["drive_offset"], jobs=0)
    assert found.findings[0].effect == "drive_offset"
    assert "an amplifier that drives the motor when it is told nothing" in sentence(found)


def test_the_report_says_in_one_line_what_was_not_offered():
    device = load_device(SCENARIOS / "piezo_stack" / "device.toml")
    device = device.model_copy(update={"effect": (), "machine": Machine(actuator="pump", transmission="none")})
    rng, t = np.random.default_rng(0), H * np.arange(300)
    drives = [2 * np.sin(2 * np.pi * f * t) for f in (11.0, 7.0)]
    records = [
        replace(record(u, 13.5e-6 * u + 1e-9 * rng.standard_normal(300), role), time=t + k)
        for k, (u, role) in enumerate(zip(drives, ("fit", "hold_out"), strict=True))
    ]
    recording = Recording("t", device.name, "series", ("reading.axis",), ("um",), (1e-9,), tuple(records), ())
    offered = {h.effect for h in hypotheses(device, nominal_physics(device), ("reading.axis",), H, False)}
    assert {"butterfly", "backlash"} <= offered
    (note,) = [n for n in diagnose(device, recording, jobs=0).notes if n.startswith("not offered")]
    assert "butterfly: it needs a ferroelectric, and its actuator is a pump" in note and "backlash" in note


def test_a_device_in_python_states_its_parts_too():
    def device(**more):
        laws = {"force": lambda u, p: [2 * u[0]], "restoring_force": lambda d, p: [p.k * d[0]]}
        return ctrlgen.user_device("m", parameters={"k": "1 N/um"}, axes={"x": "50 um"}, **laws, **more)

    def known(stated):
        return stated.parts(nominal_physics(stated))

    assert known(device(drive={"u": "2 A"})).family == "electromagnetic"
    assert known(device(drive={"u": "2 V"})).family is None
    stack = device(drive={"u": "2 V"}, machine={"actuator": "piezo stack", "sensor": "capacitive"})
    assert known(stack).family == "piezo" and "lost_beams" in not_offered(["lost_beams"], known(stack))
    told = stack.told_in({"reading.x": "mm"})  # which tells nothing of what it is
    assert known(told) == known(stack) and nominal_physics(told).pose_units == ("mm",)
