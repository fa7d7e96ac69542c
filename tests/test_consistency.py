"""The checkers of diagnosis.json and of the first screen find each contradiction that is put into one that has none."""

from __future__ import annotations

import copy
import dataclasses
import json
from types import SimpleNamespace

import pytest
from conftest import AXIS_FILE
from creeping_axis import LAWS, creeping_recording

import ctrlgen
from battery.consistency import contradictions
from battery.first_screen_check import BETTER, WORSE, screen_contradictions
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.diagnosis_first_screen import diagnosis_first_screen
from ctrlgen.diagnosis.report.diagnosis_record import Provenance, diagnosis_record
from ctrlgen.diagnosis.report.html_report import page
from ctrlgen.diagnosis.report.narrative import channel_sentence
from ctrlgen.diagnosis.selection.findings import ChannelErrorEntry
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.recordings.implausible_note import Implausible
from ctrlgen.reporting.result_file import json_text


@pytest.fixture(scope="module")
def found(tmp_path_factory) -> Diagnosis:
    """The answer for an axis that creeps."""
    return ctrlgen.diagnose(AXIS_FILE, creeping_recording(tmp_path_factory.mktemp("creeping")), laws=LAWS)


@pytest.fixture(scope="module")
def sound(found) -> dict:
    """Its diagnosis.json."""
    return json.loads(json_text(diagnosis_record(found, Provenance({}, 0))))


def test_a_sound_answer_has_no_contradiction(sound):
    assert contradictions(sound) == []


@pytest.mark.parametrize(("share", "without", "wrong"), [(0.48, 2.0, 0), (0.48, 0.5, 1), (0.4, 2.0, 1)])
def test_a_cause_with_less_than_the_largest_share_is_first_where_it_is_as_large_and_needed_more(
    sound, share, without, wrong
):
    """Two causes in place of one: the first with this share, and with what is left without it over what is left without the other."""
    changed = copy.deepcopy(sound)
    first = changed["findings"][0]
    whole, own = first["share"]["value"], first["worth"]["reading.axis"]
    other = copy.deepcopy(first) | {"effect": "drift"}
    for finding, part, left in ((first, share, without), (other, 1 - share, 1.0)):
        finding["share"] = {"value": part * whole, "ci95": [part * whole, part * whole]}
        finding["worth"] = {"reading.axis": own | {"without": left * own["without"], "share": part * own["share"]}}
    changed["findings"] = [first, other]
    assert sum("largest share is not first" in told for told in contradictions(changed)) == wrong


WRONG = {
    "a share above one": ("findings.0.share.value", 1.4),
    "a negative share": ("findings.0.share.value", -0.2),
    "an interval over zero": ("findings.0.share.ci95", [0.0, 1.0]),
    "shares that are not one": ("attribution.explained", 0.5),
    "a rest that is not that of the squares": ("held_out.reading.axis.rms_after", 60.0),
    "a channel's share that is not one with its rest": ("findings.0.worth.reading.axis.share", 0.5),
    "an error with a cause that is not that after": ("findings.0.worth.reading.axis.with_it", 60.0),
    "another unit": ("findings.0.worth.reading.axis.unit", "um"),
    "an alternative that is the cause itself": (
        "findings.0.alternatives",
        [{"effect": "creep", "location": "stage:axis", "of": None}],
    ),
    "a part of nothing": ("findings.0.role", "part"),
    "another verdict": ("verdict", "partly"),
    "consistent with findings": ("verdict", "consistent"),
    "a number outside its interval": ("findings.0.parameters.gain.value", 7.0),
    "no unit": ("findings.0.parameters.tau.unit", ""),
    "a chance that may be luck, without a word": ("findings.0.chance.by_luck", 0.3),
    "a chance below its own p": ("findings.0.chance.by_luck", 0.0),
    "a p of more signs than there are": ("findings.0.chance.stretches", 3),
    "a reason for a doubt that there is not": ("findings.0.chance.reason", "few"),
    "explained by a law whose size may be zero": ("findings.0.size_untold", True),
    "no test and no reason": ("findings.0.chance.p", None),
}


@pytest.mark.parametrize(("share", "after", "wrong"), [(0.9, 2.0, False), (1.36, 2.0, True), (0.9, 11.0, True)])
def test_an_empirical_term_takes_away_no_more_than_there_was(sound, share, after, wrong):
    term = {"effect": "empirical_position", "channel": "reading.axis", "share": share, "rms_before": 10.0}
    assert bool(contradictions(sound | {"empirical_terms": [term | {"rms_after": after}]})) is wrong


@pytest.mark.parametrize("wrong", WRONG)
def test_a_contradiction_is_found(sound, wrong):
    path, value = WRONG[wrong]
    changed = copy.deepcopy(sound)
    at = changed
    *way, last = path.replace("reading.axis", "reading:axis").split(".")
    for key in way:
        at = at[int(key)] if isinstance(at, list) else at[key.replace(":", ".")]
    assert at[last] != value
    at[last] = value
    assert contradictions(changed)


def test_consistent_beyond_the_noise_needs_numbers_that_may_move_so_far_and_says_so(sound):
    error = {
        "rms_before": 3.0,
        "rms_after": 3.0,
        "noise_floor": 1.0,
        "unit": "nm",
        "uncertainty": 2.0,
        "rms_refitted": 1.1,
        "goes_with_motion": None,
    }
    said, moved = (
        channel_sentence("reading.axis", ChannelErrorEntry(**error)),
        ", and with them moved within it 1.1 nm are left",
    )
    assert moved in said
    record = sound | {
        "verdict": "consistent",
        "findings": [],
        "held_out": {"reading.axis": error},
        "sentence": f"Consistent: it lacks nothing. {said}",
    }
    told = "consistent, and more than noise is left"
    assert told not in contradictions(record)
    assert told in contradictions(record | {"sentence": record["sentence"].replace(moved, "")})
    error["rms_refitted"] = 1.6
    assert told in contradictions(record)


def test_an_answer_whose_size_is_not_told_says_so_and_contradicts_nothing(found):
    """The law is named, as the nearest; 'explained' or 'partly' would not be believed."""
    untold = tuple(dataclasses.replace(f, size_untold=True) for f in found.findings)
    for verdict, sound_one in ((Verdict.UNEXPLAINED, True), (Verdict.PARTLY, False)):
        answer = dataclasses.replace(found, verdict=verdict, findings=untold)
        record = json.loads(json_text(diagnosis_record(answer, Provenance({}, 0))))
        assert ("the records tell the size of no law that acts so; the nearest is " in record["sentence"]) is sound_one
        assert (contradictions(record) == []) is sound_one


@pytest.mark.parametrize("p, excused", [(0.2, True), (2e-5, False), (None, False)])
def test_more_than_the_guess_of_the_noise_may_be_left_where_nothing_of_it_goes_with_the_motion(sound, p, excused):
    error = sound["held_out"]["reading.axis"] | {"rms_before": 50.0, "rms_after": 50.0, "goes_with_motion": p}
    said = "Held-out error of axis: 50 nm, noise 1 nm; the noise was neither stated nor recorded at rest and would be 50 nm in axis."
    record = sound | {"verdict": "consistent", "findings": [], "held_out": {"reading.axis": error}, "sentence": said}
    told = "consistent, and more than noise is left"
    assert (told in contradictions(record)) != excused
    assert told in contradictions(record | {"sentence": said.partition(";")[0]})


def test_a_number_of_a_sensor_is_told_in_the_unit_of_its_reading(sound):
    changed = copy.deepcopy(sound)
    first = changed["findings"][0]
    first["location"], first["parameters"]["gain"]["unit"] = "sensor:axis", "um"
    assert [text for text in contradictions(changed) if "which is read in nm" in text]


@pytest.mark.parametrize(
    ("said", "instead"),
    [
        ("Explained:", "Partly explained:"),
        (" nm -> ", " um -> "),
        ("Held-out error of axis", "Held-out error of theta"),
        ("it takes away all", "it takes away 12 % of everything, not all"),
        ("creep at", "drift at"),
        ("it takes away", "it may be luck (12 %); it takes away"),
    ],
)
def test_words_that_are_not_those_of_the_tables_are_found(sound, said, instead):
    assert said in sound["sentence"]
    assert contradictions(sound | {"sentence": sound["sentence"].replace(said, instead)})


@pytest.fixture(scope="module")
def screen(found) -> dict[str, list]:
    first = diagnosis_first_screen(found, {})
    return {"answer": list(first.answer), "numbers": [list(n) for n in first.numbers], "steps": list(first.steps)}


def test_a_sound_first_screen_has_no_contradiction(sound, screen):
    assert screen_contradictions(sound, **screen) == []


@pytest.mark.parametrize("more", ["More is said.", f"{'on and on ' * 30}"], ids=["a sentence", "a line"])
def test_an_answer_that_is_too_long_is_found(sound, screen, more):
    told = (
        [*screen["answer"], "One is said.", more]
        if more.endswith(".")
        else [f"{screen['answer'][0]} {more}", *screen["answer"][1:]]
    )
    whole = sound | {"sentence": " ".join(told).replace("\u00a0", " ")}
    (wrong,) = screen_contradictions(whole, **screen | {"answer": told})
    assert wrong.startswith("an answer of ")


WRONG_SCREEN = {
    "another answer than in diagnosis.json": ("answer", "Explained", "Certain"),
    "another error beside the figure": ("numbers", " nm", " um"),
    "a number of the other sign": ("numbers", "3.", "-3."),
    "a number outside of its interval": ("numbers", " (2", " (9"),
    "nothing to correct": ("steps", "Use device.next.toml", "Nothing to correct"),
    "numbers too uncertain that predict better": ("steps", "Use device.next.toml", f"{WORSE} device.next.toml"),
    "no number": ("numbers", " nm", " nan"),
}


@pytest.mark.parametrize("wrong", WRONG_SCREEN)
def test_a_contradiction_of_the_first_screen_is_found(sound, screen, wrong):
    where, said, instead = WRONG_SCREEN[wrong]
    text = json.dumps(screen[where]).replace("\\u00a0", " ")
    assert said in text
    changed = screen | {where: json.loads(text.replace(said, instead))}
    assert screen_contradictions(sound, **changed)


@pytest.mark.parametrize(
    "step",
    [
        "Not taken: bow at sensor:axis, although the held-out error of axis would be 9.1 nm instead of {}: few.",
        "Not taken: bow at sensor:axis, although the held-out error of axis would be 1 nm instead of 1.2 nm: few.",
        "Not taken: creep at stage:axis, although it scored better than what its round took: few.",
        "creep at stage:axis cannot be judged by luck: 1 independent stretches of the held-out records.",
    ],
)
def test_a_next_step_that_contradicts_the_answer_is_found(sound, screen, step):
    left = f"{sound['held_out']['reading.axis']['rms_after']:.4g} nm"
    assert screen_contradictions(sound, **screen | {"steps": [*screen["steps"], step.format(left)]})


@pytest.mark.parametrize(
    ("findings", "after"), [("none", 1.4), ("all", 1.4)], ids=["of no finding", "every channel worse"]
)
def test_errors_that_no_step_may_follow_from_are_found(sound, screen, findings, after):
    """Of a device that is said to predict better, or of which nothing was found."""
    changed = copy.deepcopy(sound)
    e = changed["held_out"]["reading.axis"]
    e["rms_after"] = after * e["rms_before"]
    numbers = screen["numbers"]
    if findings == "none":
        changed["findings"], numbers = [], [n for n in numbers if n[0].startswith("held-out") or n[0] == "noise"]
    told = screen | {"numbers": numbers, "steps": [BETTER]}
    assert [w for w in screen_contradictions(changed, **told) if "by no finding" in w or "every channel worse" in w]


@pytest.mark.parametrize(
    ("said", "sound_one"),
    [
        ("A constant explains 0 % (0 ... 61 %) of what the device leaves in axis.", False),
        ("Position (70 %) and a constant (60 %) explain 80 % (70 ... 90 %) of what the device leaves in axis.", False),
        ("Position (70 %) and a constant (8 %) explain 80 % (70 ... 90 %) of what the device leaves in axis.", True),
    ],
)
def test_parts_that_are_no_part_of_the_whole_are_found(sound, screen, said, sound_one):
    shares = (sound["shares"] or {}) | {"statements": [said]}
    assert (screen_contradictions(sound | {"shares": shares}, **screen) == []) == sound_one


@pytest.mark.parametrize(("value", "wrong"), [(22.3, 0), (3.0, 1)])
def test_an_interval_in_any_unit_is_read(sound, screen, value, wrong):
    told = [*screen["numbers"], ["stiffness", f"{value} (mN*m)/urad^3 (22.16 ... 22.44 (mN*m)/urad^3)"]]
    assert len(screen_contradictions(sound, **screen | {"numbers": told})) == wrong


def test_what_has_no_room_in_the_answer_stands_in_the_notes_of_every_result(found):
    why = "no balance in any of the poses of this record, " * 8
    lost = SimpleNamespace(sentences=lambda: [f"3 of 4 causes worth a fit could not be fitted: {why}."])
    told = dataclasses.replace(found, untried=lost)
    record = diagnosis_record(told, Provenance({}, 0))
    assert "3 of 4 causes worth a fit could not be fitted." in record.sentence and why not in record.sentence
    assert any(why in note for note in record.notes)
    assert why in page(told, Provenance({}, 0))


def test_what_cannot_be_right_of_the_recording_stands_before_the_answer(found):
    doubted = dataclasses.replace(found, notes=(*found.notes, Implausible("reading.axis is 10 times too large")))
    record = json.loads(json_text(diagnosis_record(doubted, Provenance({}, 0))))
    assert record["sentence"].startswith("Check this first: reading.axis is 10 times too large. Explained: ")
    assert contradictions(record) == []
    first = diagnosis_first_screen(doubted, {})
    assert first.steps[0].startswith("Before device.next.toml is used")
    assert screen_contradictions(record, list(first.answer), [list(n) for n in first.numbers], list(first.steps)) == []
    for wrong in ({"implausible": []}, {"sentence": record["sentence"].partition(". ")[2]}):
        assert contradictions(record | wrong)
