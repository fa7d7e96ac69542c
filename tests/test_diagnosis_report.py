"""What a diagnosis leaves behind: diagnosis.json, device.next.toml, the page, and the command that writes them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import record as axis_record
from conftest import AXIS_FILE, MESO_FILE
from creeping_axis import CREEP, LAWS, creeping_recording
from recording_folders import poses_recording
from result_files import faults

import ctrlgen
from ctrlgen.core.to_json import plain
from ctrlgen.diagnosis.evidence.detectability import DetectabilityEntry, SmallestDetectableEntry
from ctrlgen.diagnosis.evidence.experiment_design import CandidateExperimentEntry, Experiment
from ctrlgen.diagnosis.evidence.residual_location import ResidualPartEntry
from ctrlgen.diagnosis.evidence.unmodelled_dynamics import Coordinate, DependenceMap, UnmodelledForce
from ctrlgen.diagnosis.report.answer import answer, sentence
from ctrlgen.diagnosis.report.diagnosis_record import Provenance, diagnosis_record
from ctrlgen.diagnosis.report.figures import POINTS, residual_density, thinned
from ctrlgen.diagnosis.report.html_report import page
from ctrlgen.diagnosis.report.narrative import gathered, interval, next_steps
from ctrlgen.diagnosis.report.plot_uncertainty import draw_rivals
from ctrlgen.diagnosis.report.writeback import next_text
from ctrlgen.diagnosis.selection.findings import ChannelErrorEntry, Estimate, Finding
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.profile_likelihood import BOUNDED, Profile
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.recordings.plausibility import with_plausibility
from ctrlgen.reporting.result_file import json_text

REASON = "their effects on these readings are alike"
MADE_FROM = Provenance({"flexure_axis.toml": "0" * 64}, 3)


@pytest.fixture(scope="module")
def creeping(tmp_path_factory) -> Path:
    return creeping_recording(tmp_path_factory.mktemp("creeping"))


@pytest.fixture(scope="module")
def found(creeping):
    return ctrlgen.diagnose(AXIS_FILE, creeping, laws=LAWS)


def same_prediction(diagnosis, text: str, folder: Path) -> None:
    """The device in `text` holds the chosen fit's numbers, which predict what the fit predicts to 1e-9 of the largest
    reading; its own model may differ by how finely it integrates around its own nominal numbers."""
    (folder / "next.toml").write_text(text)
    device, fit, recording = ctrlgen.load_device(folder / "next.toml"), diagnosis.search.chosen.fit, diagnosis.recording
    stated = {path: number.si for path, number in device.quantities()}
    theta = np.array([stated.pop(unknown.path) for unknown in fit.structure.free_parameters])
    assert stated.items() <= {path: number.si for path, number in diagnosis.device.quantities()}.items()
    for record in recording.records:
        simulator = fit.structure.simulator(recording.channels, record.timing)
        own = Simulator(device, (), recording.channels, *record.timing)
        wanted = simulator.simulate(record, fit.theta)
        size = np.abs(wanted).max(axis=0)
        assert np.all(np.abs(simulator.simulate(record, theta) - wanted) <= 1e-9 * size)
        assert np.all(np.abs(own.simulate(record, np.zeros(0)) - wanted) <= 1e-6 * size)


# --- diagnosis.json


def test_the_json_is_the_contract(found):
    result = json.loads(json_text(diagnosis_record(found, MADE_FROM)))
    assert (
        faults(result, "diagnosis") == [] and result["inputs"] == MADE_FROM.inputs and result["seed"] == MADE_FROM.seed
    )
    assert result["notes"] == list(found.notes)
    assert result["verdict"] == Verdict.EXPLAINED
    (finding,) = result["findings"]
    assert set(finding) == {
        *(
            "effect",
            "location",
            "of",
            "role",
            "serves",
            "parameters",
            "terms",
            "share",
            "worth",
            "alternatives",
            "source",
        ),
        *("support", "chance", "region", "in_each_record", "size_untold"),
    }
    assert (finding["effect"], finding["location"]) == ("creep", "stage:axis")
    assert finding["of"] is None and finding["parameters"]["tau"]["unit"] == "s"
    share, worth, rest = finding["share"], finding["worth"]["reading.axis"], result["attribution"]["rest"]
    assert share["value"] == pytest.approx(result["attribution"]["explained"]) and share["value"] > 0.99
    assert (
        share["value"] + rest["value"] == pytest.approx(1.0) and share["ci95"][0] <= share["value"] <= share["ci95"][1]
    )
    assert worth["unit"] == "nm" and worth["without"] > 10 * worth["with_it"]
    assert result["sentence"] == sentence(found)
    low, high = finding["parameters"]["gain"]["ci95"]
    assert low < finding["parameters"]["gain"]["value"] < high and low < 0.03 < high
    error = result["held_out"]["reading.axis"]
    assert error["unit"] == "nm" and error["rms_refitted"] == pytest.approx(error["noise_floor"], rel=0.1)
    assert len(error) == 8 and error["goes_with_motion"] is error["counts_as"] is None
    assert error["rms_before"] > 10 * error["rms_after"] and error["noise_floor"] == pytest.approx(5, rel=0.05)
    assert 0 < error["uncertainty"] < error["noise_floor"]


def test_the_json_lists_alternatives_by_name(found):
    others = (Hypothesis("thermal_lag", "actuator:axis", "axis"), Hypothesis("swapped", "actuator:a", "a", "b"))
    rival = replace(found.findings[0], alternatives=others)
    result = diagnosis_record(replace(found, findings=(rival,)), MADE_FROM).as_json()
    assert faults(result, "diagnosis") == [] and result["findings"][0]["alternatives"] == [
        {"effect": "thermal_lag", "location": "actuator:axis", "of": None, "reason": REASON},
        {"effect": "swapped", "location": "actuator:a", "of": "b", "reason": REASON},
    ]


def test_numbers_that_are_none_are_null():
    given = {"a": float("nan"), "b": (np.float64(np.inf), np.int64(3)), "c": np.array([1.5, np.nan]), 1: np.bool_(True)}
    given["e"] = Estimate(1.0, (-np.inf, 2.0), "s")
    assert plain(given) == {
        "a": None,
        "b": [None, 3],
        "c": [1.5, None],
        "1": True,
        "e": {"value": 1.0, "ci95": [None, 2.0], "unit": "s"},
    }


def test_the_figure_of_rivals_names_every_candidate_by_what_it_adds(found):
    """One that was pruned was fitted for no single cause."""
    rounds = tuple(
        replace(r, candidates=tuple(replace(t, cause=None) for t in r.candidates)) for r in found.search.rounds
    )
    figure = draw_rivals(replace(found, search=replace(found.search, rounds=rounds)))
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert len(labels) == len(rounds[0].candidates) and labels[0].startswith("creep at stage:axis")


# --- device.next.toml


def test_the_next_device_keeps_the_authors_text_and_predicts_what_the_fit_predicts(found, tmp_path):
    text = next_text(found, AXIS_FILE.read_text())
    kept = [line for line in AXIS_FILE.read_text().splitlines() if "sd =" not in line]
    assert [line for line in text.splitlines() if line in kept and line] == [line for line in kept if line]
    assert 'was 0.5 kg"' in text and "refitted to creeping axis" in text
    assert "# Diagnosed from 'creeping axis'" in text and "Held-out error of axis" in text
    assert text.index("# Diagnosed") < text.index("[[effect]]")
    same_prediction(found, text, tmp_path)


def test_the_next_device_states_the_deviations_of_the_fit(found, tmp_path):
    (tmp_path / "next.toml").write_text(next_text(found, AXIS_FILE.read_text()))
    device, fit = ctrlgen.load_device(tmp_path / "next.toml"), found.search.chosen.fit
    stated = dict(device.quantities())
    for unknown, variance in zip(fit.structure.free_parameters, np.diag(fit.covariance), strict=True):
        assert stated[unknown.path].sd == pytest.approx(np.sqrt(variance), rel=0.01), unknown.path


def test_what_is_so_or_is_not_and_what_is_read_off_stand_in_the_next_device(found, tmp_path):
    """A saturation clips or does not: its share is not fitted, and is written all the same; so are steps of a converter."""
    clip = Hypothesis("saturation", "actuator:axis", "axis")
    trial = found.search.chosen
    structure = trial.fit.structure.with_cause(clip, {"share": 1.0, "level": 2.0})
    fit = found.fitter.fit(structure, steps=0)
    steps = {"share": Estimate(1.0, (1.0, 1.0), "1"), "quantum": Estimate(0.01, (0.01, 0.01), "um")}
    read = Finding(
        "quantisation", "sensor:axis", steps, (), None, {}, "", Hypothesis("quantisation", "sensor:axis", "axis")
    )
    screened = replace(found.search.final_screen, moved=lambda _: np.zeros(len(fit.theta)))
    search = replace(found.search, chosen=replace(trial, fit=fit), final_screen=screened)
    told = replace(found, findings=(*found.findings, read), search=search)
    (tmp_path / "next.toml").write_text(next_text(told, AXIS_FILE.read_text()))
    device = ctrlgen.load_device(tmp_path / "next.toml")
    assert [e.kind for e in device.effect] == ["creep", "saturation", "quantisation"]
    assert device.effect[1].values["share"].si == 1.0 and device.effect[1].values["level"].si == pytest.approx(2.0)
    assert device.effect[2].values["quantum"].si == pytest.approx(1e-8)


@pytest.mark.long
def test_an_effect_that_is_there_already_stays_and_the_new_one_follows(creeping, tmp_path):
    known = AXIS_FILE.read_text() + "\n# glue\n" + CREEP.replace("0.03", "0.01").replace("0.2 s", "0.05 s")
    (tmp_path / "known.toml").write_text(known)
    again = ctrlgen.diagnose(tmp_path / "known.toml", creeping, laws=LAWS)
    text = next_text(again, known)
    assert "# glue" in text and text.count('kind = "creep"') == 2 and 'tau = "0.05 s"' in text
    same_prediction(again, text, tmp_path)


@pytest.mark.long
def test_effects_written_in_one_line_are_continued_in_that_line(creeping, tmp_path):
    first = 'effect = [{ kind = "home_offset", at = "axis", offset = "0 um" }] # level\n'
    known = first + AXIS_FILE.read_text()
    (tmp_path / "known.toml").write_text(known)
    again = ctrlgen.diagnose(tmp_path / "known.toml", creeping, laws=LAWS)
    text = next_text(again, known)
    assert text.startswith("effect = [{ kind") and "# level" in text and "[[effect]]" not in text
    same_prediction(again, text, tmp_path)
    assert [e.kind for e in ctrlgen.load_device(tmp_path / "next.toml").effect] == ["home_offset", "creep"]


@pytest.mark.long
@pytest.mark.parametrize("layout", ["table", "text"])
def test_a_number_in_a_list_changes_in_place_and_says_what_it_was(tmp_path, layout):
    row = '  { value = "51 deg", source = "S0 Table 1, phi_4" },'
    written = MESO_FILE.read_text() if layout == "table" else MESO_FILE.read_text().replace(row, '  "51 deg", # mine')
    assert layout == "table" or "# mine" in written
    (tmp_path / "device.toml").write_text(written)
    (tmp_path / "true.toml").write_text(MESO_FILE.read_text().replace('"51 deg"', '"51.2 deg"', 1))
    folder = poses_recording(tmp_path, ctrlgen.load_device(tmp_path / "true.toml"))
    turned = ctrlgen.diagnose(tmp_path / "device.toml", folder, laws=LAWS)
    assert [f.cause.path for f in turned.findings] == ["hexapod.platform_angles[3]"]
    text = next_text(turned, written)
    assert "[[effect]]" not in text and text.count("diagnosed from turned strut; was 51 deg") == 1
    assert ("S0 Table 1, phi_4" in text) if layout == "table" else ("# mine" in text)
    changed = set(written.splitlines()) - set(text.splitlines())
    assert len(changed) == 1 and "51 deg" in changed.pop()
    same_prediction(turned, text, tmp_path)
    assert dict(ctrlgen.load_device(tmp_path / "next.toml").quantities())["hexapod.platform_angles[3]"].si == (
        pytest.approx(np.deg2rad(51.2), abs=1e-5)
    )


# --- the page


def test_the_page_needs_nothing_from_elsewhere_and_says_it_at_the_top(found):
    text = page(found, Provenance({"flexure_axis.toml": "0" * 64}, 7))
    links = re.findall(r"""(?:src|href)\s*=\s*["']([^"'#][^"']*)""", text) + re.findall(r"url\(([^#)]+)\)", text)
    assert all(link.startswith("data:") for link in links) and "@import" not in text and "<link" not in text
    assert "A flexure or its glue keeps moving" in text and "Explained" in text.split("<h2>")[0]
    assert text.count("<figure>") == 9 and "no kind of signal explains a hundredth of what is left" in text
    assert "seed 7" in text and "0" * 64 in text
    assert text.index("device.next.toml") < text.index("<nav")


@pytest.mark.long
def test_a_diagnosis_draws_and_pages_itself(found, tmp_path):
    """What a notebook asks of it: one figure, all of them, the page."""
    assert found.plot("residuals").figures["residuals"].startswith("<svg") and len(found.plot().figures) > 5
    assert found.report.save(tmp_path / "out") and (tmp_path / "out" / "report.html").stat().st_size > 1e5


def test_a_title_cannot_write_html(found):
    hostile = replace(found, recording=replace(found.recording, title="<script>alert(1)</script>"))
    assert "<script>alert" not in page(hostile, Provenance({}, 0))


def proposal(settles: bool) -> Experiment:
    """A proposed experiment that decides between two causes, or does not."""
    drive = CandidateExperimentEntry(kind="slow multisine", description="odd lines", strength=0.5, separation=9.0)
    series = axis_record(np.zeros(20), np.zeros(20), "fit")
    return Experiment(("creep", "drift"), "alike", 1.0, 9.0 if settles else 1.0, (drive,), series)


@pytest.mark.long
def test_the_page_shows_whatever_evidence_there_is(found):
    part = ResidualPartEntry(
        label="reading.axis", excess=4.0, ci95=(3.0, 5.0), share=1.0, mean=0.0, mean_ci95=(-1.0, 1.0), unit="um", n=9
    )
    forward = part.model_copy(update={"label": "forward"})
    nominal = found.residual_location.before.model_copy(
        update={"by_reading": [part], "by_direction": {"axis": [forward]}, "statements": ["more below 1 Hz"]}
    )
    location = found.residual_location.model_copy(update={"before": nominal})
    profile = Profile(
        "effect[0].tau",
        "creep",
        "stage:axis",
        "tau",
        0.2,
        (0.1, 0.3),
        "s",
        ((0.1, 4.0), (0.2, 0.0), (0.3, 4.0)),
        BOUNDED,
        True,
        None,
    )
    position = DependenceMap(Coordinate.POSITION, "um", (0.0, 1.0), (1.0, 2.0), (0.5, 1.5), (1.5, 2.5), "N", 0.8)
    force = UnmodelledForce("force", {"axis": 1.0}, "N", {"axis": (position,)}, ("axis",), ())
    drift = SmallestDetectableEntry(
        effect="drift",
        location="sensor:axis",
        amplitude="rate",
        detectable_from=float("nan"),
        identifiable_from=2.0,
        unit="nm/s",
        confusable_with=[],
        by_location={},
    )
    told = replace(
        found,
        residual_location=location,
        next_experiment=proposal(settles=True),
        unmodelled_force=force,
        profiles=(profile,),
        detectability=DetectabilityEntry(smallest={"drift": drift}, undetectable=[]),
    )
    text = page(told, Provenance({}, 0))
    assert text.count("<figure>") == 10
    for words in ("more below 1 Hz", "slow multisine", "added creep", "nm/s", "position explains 80 %"):
        assert words in text


def errors(before: float, after: float, noise: float | None) -> ChannelErrorEntry:
    rms = {"rms_before": before, "rms_after": after, "rms_refitted": after}
    return ChannelErrorEntry(**rms, noise_floor=noise, unit="um", uncertainty=None, goes_with_motion=None)


def test_the_answer_tells_what_is_left_where_most_is_left(found):
    """The channel that was worst, and the one that is; by chance up to 1.2 times the noise nothing is said."""
    failed = replace(found.residual_tests, passed=False)
    two = {"reading.a": errors(9.0, 1.1, 1.0), "reading.b": errors(2.0, 0.7, 0.5)}
    _, second, third = answer(replace(found, held_out=two, residual_tests=failed, verdict=Verdict.PARTLY))
    assert second.startswith("Held-out error of a: 9 um -> 1.1 um")
    assert third.startswith("Left: 0.7 um in b, 1.4 times the noise")
    for after, said in ((0.59, False), (0.61, True)):
        told = answer(replace(found, held_out={"reading.a": errors(2.0, after, 0.5)}))
        assert ("which chance allows" in told[-1]) == said and len(told) == 2 + said
    little = replace(found, held_out={"reading.a": errors(50.0, 2.0, 1.0)}, residual_tests=failed)
    assert answer(little)[-1].endswith("; too little to name, 0.1 % of the error.")
    assert "too little" not in answer(replace(little, verdict=Verdict.PARTLY))[-1]
    (*_, last) = answer(replace(found, held_out={"reading.a": errors(2.0, 0.5, None)}))
    assert last.startswith("Whether more is left cannot be said")


def test_a_verdict_says_what_to_do(found):
    rival = replace(found.findings[0], alternatives=(Hypothesis("thermal_lag", "actuator:axis", "axis"),))
    told = {
        v: replace(found, verdict=v, findings=(rival,))
        for v in (Verdict.EXPLAINED, Verdict.PARTLY, Verdict.AMBIGUOUS, Verdict.UNEXPLAINED)
    }
    told[Verdict.CONSISTENT] = replace(found, verdict=Verdict.CONSISTENT, findings=())
    first = {verdict: (sentence(d).split(":")[0], next_steps(d)[0]) for verdict, d in told.items()}
    assert len(set(first.values())) == 5
    assert first[Verdict.CONSISTENT][1].startswith("Nothing to correct") and first[Verdict.EXPLAINED][1].startswith(
        "Use device.next.toml"
    )
    assert "Check wiring, units and clocks" in next_steps(told[Verdict.UNEXPLAINED])[1]
    assert "cannot tell it from thermal_lag at actuator:axis" in sentence(told[Verdict.AMBIGUOUS])
    assert "thermal_lag" not in sentence(told[Verdict.EXPLAINED])
    for settles, said in ((True, "Run the next experiment"), (False, "None of the drives considered")):
        assert next_steps(replace(told[Verdict.AMBIGUOUS], next_experiment=proposal(settles)))[0].startswith(said)
    assert "no known effect" in sentence(replace(found, verdict=Verdict.UNEXPLAINED, findings=()))


@pytest.mark.parametrize(
    ("value", "low", "high", "unit", "says"),
    [
        (0.041, 0.039, 0.043, "1", "4.1 % (3.9 ... 4.3 %)"),
        (312.0, 300.0, 324.0, "nm", "312 nm (300 ... 324 nm)"),
        (2.5, 2.4, 2.6, "1", "2.5 (2.4 ... 2.6)"),
        (0.5, 0.3, 0.5, "s", "500 ms (300 ... 500 ms, at its bound)"),
        (0.5, -np.inf, np.inf, "s", "500 ms (this recording does not determine it)"),
    ],
)
def test_intervals_read_well(value, low, high, unit, says):
    assert interval(Estimate(value, (low, high), unit)) == says


def test_a_long_curve_keeps_its_peaks():
    y = np.random.default_rng(0).standard_normal(50_000)
    y[31_234], y[100] = 40.0, np.nan
    x, thin = thinned(np.arange(50_000.0), y)
    assert len(x) <= 2 * POINTS and np.max(thin) == 40.0 and x[np.argmax(thin)] == 31_234 and np.all(np.diff(x) > 0)


def test_the_spectrum_of_a_short_stretch_behind_a_long_lead_in_is_that_of_the_stretch():
    """White noise of 3 nm at 1 kHz has the density 3 sqrt(2/1000) nm/sqrt(Hz), wherever in the record it is judged."""
    white = np.concatenate([np.full(3100, np.nan), 3.0 * np.random.default_rng(1).standard_normal(1200)])[:, None]
    left = SimpleNamespace(records=[SimpleNamespace(time=np.arange(4300) * 1e-3, sample_time=1e-3)])
    f, density = residual_density(left, [white], [0], 0)
    assert np.sqrt(np.mean(density[f > 20] ** 2)) == pytest.approx(3 * np.sqrt(2e-3), rel=0.1)


def test_notes_alike_are_said_once():
    notes = ("reading.x: as stated", "reading.y: as stated", "a.csv: 3 spikes")
    assert gathered(notes) == ["reading.x, reading.y: as stated", "a.csv: 3 spikes"]


@pytest.mark.long
def test_objects_and_paths_give_the_same_answer_and_the_same_page(creeping, found):
    model = ctrlgen.build_model(ctrlgen.load_device(AXIS_FILE))
    recording = with_plausibility(ctrlgen.load_recordings([creeping], model), model)
    again = ctrlgen.diagnose(model.device, recording, laws=LAWS)
    assert isinstance(again, ctrlgen.Diagnosis) and diagnosis_record(again, MADE_FROM) == diagnosis_record(
        found, MADE_FROM
    )
    assert page(again, Provenance({}, 0)) == page(found, Provenance({}, 0))
    several = ctrlgen.diagnose(str(AXIS_FILE), [str(creeping / "recording.toml")], laws=LAWS)
    assert diagnosis_record(several, MADE_FROM) == diagnosis_record(found, MADE_FROM)
