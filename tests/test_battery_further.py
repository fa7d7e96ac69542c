"""Proof of the battery's classes `regional`, `gaps`, `spikes` and of the judges of regions, shares and what stands beside the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from battery import cases, gap_cases, judge, laws, laws_region, memory, region_cases, rough_cases, score, spike_cases
from battery.judge_further import agreement
from battery.plant_axis import Axis, Planted, Scene
from battery.region import Region, overlap, stated
from battery.score_further import evidence_table
from battery.seal import unseal

AXIS = Axis(0.5, 30.0, 2e5, 10.0, 1e-4, 10.0)
SCENE = Scene(AXIS, 2e-5, 1e-2, 7e-5, 1.0, 1.5)
FORCES = (
    "friction_there",
    "friction_between",
    "friction_from",
    "stick_from",
    "friction_one_way",
    "damping_there",
    "damping_between",
    "damping_fast",
    "knee",
    "stop_there",
)


def planted(name, seed=3):
    return laws.draw(name, np.random.default_rng(seed), SCENE)


def inside(region, t, q, v):
    at = {"time": t, "position": q, "velocity": v}
    return bool(region.mask({of: np.array([x]) for of, x in at.items()})[0])


@pytest.mark.parametrize("name", FORCES)
def test_a_force_acts_in_its_region_and_nowhere_else(name):
    law, rng, seen = planted(name), np.random.default_rng(1), {True: [], False: []}
    region = laws_region.region_of(law)
    for _ in range(60):
        t, q, v = rng.uniform(0, 1.5), rng.uniform(-7e-5, 7e-5), rng.choice([-1, 1]) * rng.uniform(2e-3, 3e-2)
        (hooks,) = laws.build([law], SCENE)
        for k in range(400):  # bristles have slipped after a while
            force = hooks.force(t + 1e-9 * k, q, v)
        seen[inside(region, t, q, v)].append(abs(force))
    assert len(seen[True]) > 5 and len(seen[False]) > 5
    ramp = 2  # samples on the ramp of an edge, at most
    assert sorted(seen[False])[-1 - ramp] <= 2e-3 * np.median(seen[True])
    assert sorted(seen[True])[ramp] > 0


def test_a_drive_a_reading_and_a_play_change_in_their_regions_only():
    gain, scratch, play, warm = (planted(n) for n in ("gain_beyond", "scratch", "play_there", "warm_reading"))
    above = gain.shape["above"]
    (hooks,) = laws.build([replace(gain, amplitude=0.5)], SCENE)
    assert hooks.drive(0, 0.9 * above) == 0.9 * above and hooks.drive(0, -3 * above) == pytest.approx(-4 * above)
    y = np.linspace(-7e-5, 7e-5, 701)
    (hooks,) = laws.build([scratch], SCENE)
    off = hooks.sensed(y, y, y) - y
    at = laws_region.region_of(scratch).mask({"position": y})
    assert np.all(off[~at] == 0) and off.max() == pytest.approx(scratch.amplitude, rel=0.02)
    (hooks,) = laws.build([replace(warm, shape={"above": 296.0}, amplitude=2.0)], SCENE)
    assert hooks.sensed(y[:3], np.zeros(3), np.array([295.0, 296.0, 297.0])).tolist() == [0, 0, 2]
    (hooks,) = laws.build([replace(play, shape={"at": 0.0, "side": 1.0}, amplitude=1e-6)], SCENE)
    way = np.concatenate([np.linspace(-4e-5, 4e-5, 900), np.linspace(4e-5, -4e-5, 900)])
    lost = hooks.carried(way, way, way) - way
    assert np.abs(lost[(way < -1e-6)]).max() < 1e-12 and np.ptp(lost[way > 2e-5]) == pytest.approx(1e-6, rel=1e-6)


def test_a_force_repeats_along_the_way_and_takes_no_energy():
    law = replace(planted("cogging"), amplitude=0.1)
    q = np.linspace(0, law.shape["period"], 801)
    (hooks,) = laws.build([law], SCENE)
    force = np.array([hooks.force(0, x, 1e-3) for x in q])
    assert force[0] == pytest.approx(force[-1], abs=1e-12) and np.trapezoid(force, q) == pytest.approx(0, abs=1e-12)
    assert 0.1 <= np.abs(force).max() < 0.13


def test_weights_of_a_stack_lie_where_its_name_says():
    def weights(name):
        shape = memory.draw_shape(name, np.random.default_rng(3), 1.0, 1.0)
        return np.array(shape["weights"])

    narrow, wide, humps = (weights(name) for name in ("narrow_stack", "wide_stack", "humped_stack"))
    half = len(wide) // 2
    assert wide == pytest.approx(narrow[::-1]) and narrow[:half].sum() > 0.5
    middle = humps[len(humps) // 2]
    assert humps[: len(humps) // 3].max() > 2 * middle < humps[-len(humps) // 3 :].max()


def test_long_creep_is_a_logarithm_of_time():
    t = np.arange(20000) * 0.01
    y = memory.long_creep(t, np.ones(20000), 0.6, 1e-3)
    at = y[[9, 99, 999]]  # 0.1 to 10 s
    assert np.diff(at) == pytest.approx(0.6 * 4 / 25, rel=0.01)  # four of 25 relaxations a decade


def test_a_chain_of_plays_is_a_play_where_they_are_alike():
    x = np.cumsum(np.random.default_rng(0).standard_normal(200))
    one = memory.free_play(x, x, 0.4, 0.2)
    assert memory.play_of_many(x, x, 0.4, 0.2, 0.0, 5) == pytest.approx(one)
    assert memory.play_of_many(x, x, 0.4, 0.2, 0.4, 5) != pytest.approx(one, abs=1e-3)


def test_regions_of_samples():
    at = {"position": np.arange(10.0), "velocity": np.array([1, 1, 1, 1, 1, -1, -1, -1, -1e-6, 1e-6])}
    at["time"] = np.arange(10.0)
    low, high = Region("position", -np.inf, 4.0), Region("position", 2.0, np.inf)
    assert low.mask(at).sum() == 5 and overlap(low.mask(at), high.mask(at)) == pytest.approx(3 / 10)
    assert overlap(np.zeros(3, bool), np.zeros(3, bool)) == 1
    samples = {"fit": at, "hold_out": {of: x + 10 if of == "time" else x for of, x in at.items()}}
    ahead, all_of = Region("velocity", 0.0, np.inf), Region("velocity", -np.inf, np.inf)
    assert agreement(ahead, ahead, samples) == 1
    assert agreement(ahead, all_of, samples) == pytest.approx(5 / 8)  # where it stands, no direction counts
    assert agreement(low, None, samples) == pytest.approx(0.5)  # a law everywhere
    assert agreement(Region("time", 5.0, np.inf), Region("time", 10.0, np.inf), samples) == pytest.approx(10 / 15)
    assert agreement(low, Region("temperature", 0.0, 1.0), samples) == 0  # which nobody measured


def numbers(**values):
    return {name: {"value": v, "unit": unit, "ci95": [v, v]} for name, (v, unit) in values.items()}


def finding(effect, location="stage:axis", share=0.9, alternatives=(), **values):
    return {
        "effect": effect,
        "location": location,
        "share": {"value": share, "ci95": [share, share]},
        "parameters": numbers(**values),
        "alternatives": [{"effect": e, "location": "stage:axis"} for e in alternatives],
    }


@pytest.mark.parametrize(
    "effect, values, region",
    [
        ("coulomb_above", {"edge": (5.0, "um")}, Region("position", 5e-6, np.inf)),
        ("viscous_below", {"edge": (-5.0, "um")}, Region("position", -np.inf, -5e-6)),
        ("viscous_at_speed", {"speed": (2.0, "um/s")}, Region("speed", 2e-6, np.inf)),
        ("coulomb_after", {"moment": (3.0, "s")}, Region("time", 3.0, np.inf)),
        ("end_stop", {"gap": (-8.0, "um")}, Region("position", -np.inf, -8e-6)),
        ("saturation", {"level": (0.5, "V")}, Region("drive size", 0.5, np.inf)),
        ("directional_friction", {"skew": (-0.9, "1")}, Region("velocity", -np.inf, 0.0)),
        ("directional_friction", {"skew": (0.1, "1")}, None),
        ("coulomb", {"force": (1.0, "N")}, None),
    ],
)
def test_the_region_that_a_finding_states(effect, values, region):
    found = stated(finding(effect, **values))
    assert (found is None) == (region is None)
    if region:
        assert found.of == region.of
        assert (found.low, found.high) == (pytest.approx(region.low), pytest.approx(region.high))


@pytest.mark.parametrize(
    "quantity, size, lower, upper, region",
    [
        ("position", False, -2.0, 3.0, Region("position", -2e-6, 3e-6)),
        ("position", True, 2.0, None, Region("position size", 2e-6, np.inf)),
        ("speed", True, 4.0, None, Region("speed", 4e-6, np.inf)),
        ("temperature", False, None, 5.0, Region("rise", -np.inf, 5e-6)),
    ],
)
def test_a_region_that_is_told_counts_before_what_a_name_says(quantity, size, lower, upper, region):
    ends = {end: None if v is None else {"value": v, "ci95": [v, v]} for end, v in (("lower", lower), ("upper", upper))}
    told = ends | {"quantity": quantity, "size": size, "unit": "um"}
    found = stated(finding("coulomb_above", edge=(5.0, "um")) | {"region": told})
    assert (found.of, found.low, found.high) == (region.of, pytest.approx(region.low), pytest.approx(region.high))


def test_the_interval_of_an_end_holds_the_true_one_or_not():
    def told(low, high):
        end = {"value": (low + high) / 2, "ci95": [low, high]}
        return {"region": {"quantity": "position", "size": False, "lower": end, "upper": None, "unit": "um"}}

    drag = finding("coulomb_above", edge=(2.0, "um"))
    ends = [judged(DRAG, drag | more).further.located.edges for more in (told(1.9, 2.2), told(2.1, 2.2), {})]
    assert ends == [(True,), (False,), ()]
    rows = {r.what: r for r in score.table([judged(DRAG, drag | told(1.9, 2.2))])}
    assert rows["regional, coverage of the ends' 95 % intervals"].hits == 1


def test_a_rise_of_temperature_is_over_the_mean_of_the_record_to_fit():
    record = {"velocity": np.ones(10), "time": np.arange(10.0), "temperature": 295 + np.arange(10.0)}
    samples = {"fit": record, "hold_out": record}
    assert agreement(Region("temperature", 299.5, np.inf), Region("rise", 0.0, np.inf), samples) == 1


GRID = {"position": np.linspace(-1e-5, 1e-5, 201).tolist(), "velocity": [1e-3] * 201, "drive": [0.0] * 201}
DRAG = {
    "case": "case_1",
    "class": "regional",
    "planted": [
        {
            "name": "friction_there",
            "family": None,
            "location": "stage:axis",
            "amplitude": 0.2,
            "shape": {},
            "share": 1.0,
            "share_varying": 1.0,
        }
    ],
    "background": [],
    "noise": {"sd": 5e-9, "phi": 0.0},
    "device": "axis",
    "rough": False,
    "least_error": 0.0,
    "region": {"of": "position", "low": 2e-6, "high": np.inf},
    "samples": {"fit": GRID | {"time": [0.0] * 201}, "hold_out": GRID | {"time": [1.0] * 201}},
}


def judged(answer, *findings, error=5.0, **more):
    held = {"reading.axis": {"rms_before": 90.0, "rms_after": error, "noise_floor": 5.0, "unit": "nm"}}
    return judge.judge(answer, {"verdict": "explained", "findings": list(findings), "held_out": held} | more)


def test_a_law_in_a_region_is_right_half_right_or_wrong():
    right = judged(DRAG, finding("coulomb_above", edge=(2.5, "um"))).further
    assert right.located.law and right.located.found and right.over_best == pytest.approx(1) and not right.worse
    half = judged(DRAG, finding("coulomb_above", edge=(-6.0, "um"))).further
    assert half.located.law and not half.located.found and half.located.overlap == pytest.approx(0.5, abs=0.01)
    assert half.located.f1 == pytest.approx(2 / 3, abs=0.01)  # all true samples among twice as many
    everywhere = judged(DRAG, finding("coulomb", force=(0.2, "N"))).further
    assert everywhere.located.law and not everywhere.located.found and everywhere.located.overlap < 0.5
    wrong = judged(DRAG, finding("asymmetric_viscous")).further
    assert not wrong.located.law and wrong.located.overlap == 0
    second = judged(DRAG, finding("drift", "sensor:axis", 0.6), finding("coulomb_above", share=0.3, edge=(2.0, "um")))
    assert not second.further.located.law and second.further.located.found
    assert not second.rough.nothing_beside and second.further.first == ("drift", "sensor:axis")


def test_a_region_counts_as_false_where_the_law_acts_everywhere_or_nothing_does():
    everywhere = {"name": "coulomb", "location": "stage:axis", "amplitude": 0.2, "shape": {}}
    single = {"case": "c", "class": "single", "planted": [everywhere], "noise": {"sd": 5e-9}}
    assert judged(single, finding("coulomb_above", edge=(1.0, "um"))).further.false_region
    assert not judged(single, finding("coulomb", force=(0.2, "N"))).further.false_region
    stop = single | {"planted": [everywhere | {"name": "end_stop"}]}
    assert not judged(stop, finding("end_stop", gap=(1.0, "um"))).further.false_region
    null = single | {"class": "null", "planted": []}
    both = [judged(null, *found) for found in ([], [finding("end_stop", gap=(1.0, "um"))])]
    assert [j.further.false_region for j in both] == [False, True]
    rows = {r.what: r for r in score.table(both)}
    assert rows["region stated where none is"].hits == 1 and rows["region stated where none is"].n == 2


def test_an_answer_may_not_be_worse_than_the_device_as_described():
    assert judged(DRAG, finding("coulomb_above", edge=(2.0, "um")), error=95.0).further.worse
    failed = judge.judge(DRAG, None)
    rows = {r.what: r for r in score.table([failed, judged(DRAG, finding("coulomb_above", edge=(2.0, "um")))])}
    assert (rows["regional, law first"].hits, rows["regional, law first"].n) == (1, 2)
    assert rows["held-out error worse than before"].met and rows["regional, region overlaps by 0.8"].hits == 1
    half = judged(DRAG, finding("coulomb_above", edge=(-6.0, "um")))
    rows = {r.what: r for r in score.table([half, judged(DRAG, finding("asymmetric_viscous")), failed])}
    localised = rows["regional, localisation F1, mean"]
    assert localised.value == pytest.approx(1 / 3, abs=0.01) and localised.n == 2 and not localised.met


def test_rows_that_are_missing_are_judged_against_the_whole_record():
    truth = DRAG["planted"][0] | {"name": "free_play", "family": "backlash"}
    base = {k: v for k, v in DRAG.items() if k not in {"region", "samples"}} | {"class": "gaps", "planted": [truth]}
    play, lag = finding("backlash", gap=(1.0, "um")), finding("creep")
    whole = judged(base | {"set": "7", "way": "none"}, play)
    same = judged(base | {"set": "7", "way": "single"}, play, error=5.4)
    other = judged(base | {"set": "7", "way": "runs"}, lag, error=5.6)
    whole.cpu, same.cpu, other.cpu = 20.0, 25.0, 27.0
    rows = {r.what: (r.hits, r.n) for r in score.table([whole, same, other])}
    what = "1 % of rows missing, "
    assert rows[what + "same finding"] == (1, 2)
    assert rows[what + "held-out error within 10 %"] == (1, 2) and rows[what + "CPU within 1.3 x"] == (1, 2)
    assert rows["a long gap, same finding"] == (0, 0)


def test_hidden_spikes_are_counted():
    truth = DRAG["planted"][0] | {"name": "coulomb"}
    base = {k: v for k, v in DRAG.items() if k not in {"region", "samples"}}
    base |= {"class": "spikes", "planted": [truth], "hidden_spikes": 50}
    right, few = (judged(base, finding("coulomb"), spikes={"y": {"count": n}}, error=e) for n, e in ((52, 6), (30, 9)))
    assert right.further.spikes == pytest.approx(1.04)
    rows = {r.what: (r.hits, r.n) for r in score.table([right, few, judge.judge(base, None)])}
    assert rows["hidden spikes, cause first"] == (2, 3) and rows["hidden spikes, told within a tenth"] == (1, 3)
    assert rows["hidden spikes, held-out error <= 1.5 x least possible"] == (1, 3)


def test_what_the_shares_say_is_weighed_against_the_finding():
    def shares(family, share):
        return {"shares": {"before": {"families": [{"family": family, "share": share}]}}}

    drag = finding("coulomb_above", edge=(2.0, "um"))
    all_of = [
        judged(DRAG, drag, **shares("dry friction", 0.8)),
        judged(DRAG, drag | {"support": {"contradicted": True}}, **shares("hysteresis", 0.6)),
        judged(DRAG, finding("drift"), **shares("dry friction", 0.4)),
        judged(DRAG, drag, shares=None),
    ]
    tied = [{"family": f, "share": 0.5} for f in ("hysteresis", "dry friction", "dynamics")]
    assert judged(DRAG, drag, shares={"before": {"families": tied}}).further.evidence.right
    assert [j.further.evidence and j.further.evidence.right for j in all_of] == [True, False, True, None]
    table = evidence_table(all_of)
    assert table[4] == "| 0.5 to 0.75 | 1 | 1 | 0 | 1 | 1 |" and table[-1] == "| all | 3 | 1 | 1 | 1 | 1 |"


def test_false_names_and_several_causes():
    two = [
        DRAG["planted"][0] | {"name": n, "share": s, "share_varying": s} for n, s in (("coulomb", 0.6), ("bow", 0.3))
    ]
    base = {k: v for k, v in DRAG.items() if k not in {"region", "samples"}} | {"class": "messy", "planted": two}
    both = [finding("coulomb", share=0.6), finding("bow", "sensor:axis", 0.3)]
    good, loud, short = (
        judged(base, *both, finding("drift", "sensor:axis", 0.02)),
        judged(base, *both, finding("drift", "sensor:axis", 0.06)),
        judged(base, both[0]),
    )
    assert (good.further.false_name, loud.further.false_name) == (False, True)
    rows = {r.what: (r.hits, r.n) for r in score.table([good, loud, short])}
    assert rows["several causes, all named"] == (2, 3) and rows["messy, false name above 5 % share"] == (1, 3)


def test_every_law_is_in_the_plan_and_gaps_come_in_sets():
    rng = np.random.default_rng(2)
    assert {name for (name,) in region_cases.plan(rng, 14)} == set(laws_region.NAMES)
    rows = gap_cases.plan(rng, 8)
    assert [row[2] for row in rows[:4]] == list(gap_cases.WAYS) and len({row[3] for row in rows}) == 2
    assert {row[0] for row in spike_cases.plan(rng, 6)} == {"axis", "mems", "meso"}
    assert ("axis", "single", "cogging") in rough_cases.plan("forms", rng, 26)


def test_rows_are_missing_one_by_one_in_runs_or_in_one_gap():
    rng = np.random.default_rng(0)
    single, runs, long = (gap_cases.missing(4000, way, rng) for way in ("single", "runs", "long"))
    assert single.sum() == 40 and 40 <= runs.sum() <= 48 and long.sum() == 200
    assert np.diff(single.astype(int)).clip(0).sum() > 30 > np.diff(runs.astype(int)).clip(0).sum() > 5
    assert np.diff(long.astype(int)).clip(0).sum() == 1 and not gap_cases.missing(4000, "none", rng).any()


def test_spikes_are_smaller_than_the_law_and_apart():
    e = spike_cases.spikes(np.random.default_rng(0), 3000, 0.01, 60.0)
    at = np.flatnonzero(e)
    assert len(at) == 30 and np.diff(at).min() >= spike_cases.APART
    assert np.abs(e[at]).min() >= 8 and np.abs(e[at]).max() <= 42


WANTED = {
    "regional": ("gain_beyond",),
    "gaps": ("servo", "free_play", "runs", "11"),
    "spikes": ("meso", "bow"),
    "forms": ("meso", "single", "humped_stack"),
}


@pytest.mark.long
@pytest.mark.parametrize("kind", WANTED)
def test_a_case_tells_nothing_and_its_seed_reproduces_it(tmp_path, monkeypatch, kind):
    monkeypatch.setattr(region_cases, "SECONDS", 1.0)
    order = cases.Order(1, kind, WANTED[kind], (5, 1), 2.0)
    for folder in ("a", "b"):
        cases.make_case(order, tmp_path / folder)
    words = {*laws_region.NAMES, *memory.FAMILIES, "region", "spike", "gap", "edge", "planted"}
    for path in sorted((tmp_path / "a").rglob("*.*")):
        assert path.read_bytes() == (tmp_path / "b" / path.relative_to(tmp_path / "a")).read_bytes()
        told = path.name in {"recording.toml", "device.toml"}
        assert not told or not any(word in path.read_text() for word in words), path.name
    answer = unseal(tmp_path / "a" / "answers" / "case_0001.json")
    assert answer["class"] == kind and answer["planted"][0]["share"] > 0.9
    if kind == "regional":
        region = Region(**answer["region"])
        assert 0.1 <= region.mask({k: np.array(v) for k, v in answer["samples"]["hold_out"].items()}).mean() <= 0.8
    if kind == "spikes":
        assert answer["hidden_spikes"] >= 2


def test_a_set_of_gaps_is_one_record_with_rows_taken_out(tmp_path):
    rows = {}
    for way in ("none", "single"):
        write, _ = gap_cases.make(("servo", "free_play", way, "11"), None)
        write(tmp_path / way)
        rows[way] = (tmp_path / way / "record_1.csv").read_text().splitlines()
    left = set(rows["single"])
    assert left < set(rows["none"]) and len(rows["none"]) - len(rows["single"]) == round(0.01 * (len(rows["none"]) - 1))


def test_a_plant_is_where_the_answer_says():
    scene, law = SCENE, Planted("knee", 1e4, {"at": 1e-5, "side": 1.0, "bend": 0.0})
    take = region_cases.Take("fit", np.sin(np.arange(300) / 30), np.zeros(300), None, 2.0)
    bench = region_cases.Bench(AXIS, AXIS, scene, (take,), False, True)
    at = region_cases.samples_of(bench, take, [law])
    assert at["time"][0] == 2.0 and len(at["position"]) == 300 and scene.substeps > 1
    speed = np.gradient(at["position"], 1e-3)
    assert at["velocity"][20:-20] == pytest.approx(speed[20:-20], abs=0.05 * np.abs(speed).max())
