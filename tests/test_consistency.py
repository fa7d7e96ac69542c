"""The checker of diagnosis.json finds each contradiction that is put into a file that has none."""

from __future__ import annotations

import copy
import json

import pytest
from conftest import AXIS_FILE
from creeping_axis import LAWS, creeping_recording

import ctrlgen
from battery.consistency import contradictions
from ctrlgen.diagnosis.report.diagnosis_record import Provenance, diagnosis_record
from ctrlgen.reporting.result_file import json_text


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> dict:
    """The answer for an axis that creeps."""
    found = ctrlgen.diagnose(AXIS_FILE, creeping_recording(tmp_path_factory.mktemp("creeping")), laws=LAWS)
    return json.loads(json_text(diagnosis_record(found, Provenance({}, 0))))


def test_a_sound_answer_has_no_contradiction(sound):
    assert contradictions(sound) == []


WRONG = {
    "a share above one": ("findings.0.share.value", 1.4),
    "a negative share": ("findings.0.share.value", -0.2),
    "an interval over zero": ("findings.0.share.ci95", [0.0, 1.0]),
    "shares that are not one": ("attribution.explained", 0.5),
    "a rest that is not that of the squares": ("held_out.reading.axis.rms_after", 60.0),
    "a channel's share that is not one with its rest": ("findings.0.worth.reading.axis.share", 0.5),
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
    "no test and no reason": ("findings.0.chance.p", None),
}


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
