"""The region that a finding states: which end is open, with which interval, in which words."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, fitter_of
from region_edges import found
from scipy.stats import norm

from ctrlgen.diagnosis.report.answer import where
from ctrlgen.diagnosis.selection.edge_intervals import edge_intervals, moved_by_form, out_to_visited
from ctrlgen.diagnosis.selection.finding_region import region_of
from ctrlgen.diagnosis.selection.findings import Estimate, estimated_values, finding_estimates
from ctrlgen.diagnosis.selection.motion_regions import along_region, no_region
from ctrlgen.effects import Effect, Place
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure

UM = {"edge": Estimate(-11.5, (-11.51, -11.49), "um"), "gap": Estimate(-3.0, (-3.1, -2.9), "um")}
SCRATCH = {"position": Estimate(4.0, (3.9, 4.1), "um"), "length": Estimate(2.0, (1.8, 2.2), "um")}
NUMBERS = (
    UM
    | SCRATCH
    | {
        "moment": Estimate(1.2, (1.1, 1.3), "s"),
        "speed": Estimate(2.0, (1.9, 2.1), "mm/s"),
        "level": Estimate(0.5, (0.4, 0.6), "V"),
        "reference": Estimate(1.0, (0.9, 1.1), "K"),
    }
)
WORDS = {
    "coulomb_above": "above a position of -11.5 um (-11.51 ... -11.49 um)",
    "viscous_below": "below a position of -11.5 um (-11.51 ... -11.49 um)",
    "coulomb_on_stretch": "between positions of 3 um (2.86 ... 3.14 um) and 5 um (4.86 ... 5.14 um)",
    "end_stop": "below a position of -3 um (-3.1 ... -2.9 um)",
    "coulomb_after": "from 1.2 s (1.1 ... 1.3 s) on",
    "viscous_at_speed": "above a speed of 2 mm/s (1.9 ... 2.1 mm/s)",
    "drive_gain_beyond": "beyond drives of +-0.5 V (0.4 ... 0.6 V)",
    "local_error": "between positions of 3 um (2.86 ... 3.14 um) and 5 um (4.86 ... 5.14 um)",
    "temperature_sensitivity_above": "above a rise of the temperature of 1 K (0.9 ... 1.1 K)",
}


@pytest.mark.parametrize("kind", WORDS)
def test_a_sentence_says_where_a_law_acts(kind):
    (said,) = where(SimpleNamespace(region=region_of(Effect.library[kind], NUMBERS)))
    assert said == WORDS[kind]


def test_a_law_that_acts_everywhere_has_no_region():
    assert region_of(Effect.library["coulomb"], NUMBERS) is None
    assert where(SimpleNamespace(region=None)) == []


def test_the_open_end_of_a_region_is_null():
    below = region_of(Effect.library["coulomb_below"], NUMBERS)
    assert below.lower is None and below.upper.value == -11.5 and below.unit == "um"
    farther = region_of(Effect.library["stiffness_beyond"], NUMBERS)
    assert farther.size and farther.upper is None and farther.lower.ci95 == (-11.51, -11.49)


def test_the_interval_of_an_end_holds_the_ramp_over_which_the_law_sets_in():
    """The straight ramp that is as gradual as (1 + tanh(2 x/w))/2 is pi/2 times w long; that of a moment is told by its duration."""
    wide = NUMBERS | {"width": Estimate(2.0, (1.0, 3.0), "um"), "rise": Estimate(0.4, (0.3, 0.5), "s")}
    end = region_of(Effect.library["coulomb_above"], wide).lower
    assert end.value == -11.5 and end.ci95 == pytest.approx((-11.51 - np.pi / 2, -11.49 + np.pi / 2))
    assert region_of(Effect.library["coulomb_after"], wide).lower.ci95 == pytest.approx((0.9, 1.5))
    bell = region_of(Effect.library["local_error"], NUMBERS | {"rounding": Estimate(4.0, (3.0, 5.0), "um")})
    assert bell.upper.ci95 == pytest.approx((5 - 0.02**0.5 - np.pi, 5 + 0.02**0.5 + np.pi))


def test_an_edge_is_told_by_the_places_that_are_visited():
    places = np.array([1.0, 2.0, 3.0, 4.0])
    assert out_to_visited((2.2, 2.3), places) == (2.0, 3.0)
    assert out_to_visited((2.2, 3.1), places) == (2.0, 4.0)
    assert out_to_visited((2.0, 3.0), places) == (2.0, 3.0)
    # where none is visited any more, the fit alone tells
    assert out_to_visited((0.5, 4.5), places) == (0.5, 4.5)


def test_a_bent_spring_moves_its_edge():
    """Of depths that are visited alike, the line nearest to s^2 is s - 1/6, and rms(s)/rms(s^2) is sqrt(5/3)."""
    depth = np.linspace(-3.0, 2.0, 5001)
    assert moved_by_form(depth, 0.05) == pytest.approx(0.05 * (5 / 3) ** 0.5 / 6 * 2.0, rel=2e-3)
    # a single touch tells no form
    assert moved_by_form(np.array([-1.0, 0.5]), 0.05) == 0.5


def test_a_finding_tells_its_edge_no_more_narrowly_than_that():
    fitter, edge = fitter_of(n=400), 5e-6
    fits = {
        kind: fitter.fit(
            Structure(AXIS).with_cause(Hypothesis(kind, "stage:axis", "axis"), numbers | {"edge": edge}), steps=0
        )
        for kind, numbers in (
            ("viscous_above", {"damping": 60.0, "width": 4e-6}),
            ("stiffness_below", {"stiffness": 2e4}),
        )
    }
    for kind, fit in fits.items():
        path = next(u.path for u in fit.structure.free_parameters if u.name == "edge")
        plain, told = estimated_values(fit)[path], finding_estimates(fitter, fit)[path]
        places = next(r for r in fitter.fit_records)
        ways = fitter.simulator(fit.structure, places).simulate_states(places, fit.theta)[0]
        visited = np.unique(ways[:, -1]) * 1e6
        assert told.ci95[0] < plain.ci95[0] and told.ci95[1] > plain.ci95[1]
        assert min(np.abs(visited - told.ci95[0])) < 1e-6 and min(np.abs(visited - told.ci95[1])) < 1e-6
        depth = edge - ways[:, -1]
        # a damper has a ramp; a spring grows from nothing
        unsure = norm.ppf(0.975) * moved_by_form(depth, 0.05) * 1e6 if kind == "stiffness_below" else 0.0
        assert told.ci95[1] - told.ci95[0] >= 2 * unsure and visited[-1] > told.ci95[1]
        (by_form,) = edge_intervals(fitter, fit, {path: (5.0, 5.0) for path in estimated_values(fit)}).values()
        assert by_form == pytest.approx(out_to_visited((5.0 - unsure, 5.0 + unsure), visited))
        # a place is between it and where one standard deviation would end
        assert not unsure or by_form[1] > out_to_visited((0.0, 5.0 + unsure / 2), visited)[1]


@pytest.mark.parametrize("level", [-0.8, -0.2, 0.2, 0.8])
def test_a_limit_of_one_sign_has_its_edge_beside_drives_of_that_sign(level):
    """Drives of both signs are recorded: the edge ends at the next of them, not across zero."""
    fitter = fitter_of(n=400)
    limit = Hypothesis("one_sided_saturation", "actuator:axis", "axis")
    fit = fitter.fit(Structure(AXIS).with_cause(limit, {"level": level}), steps=0)
    path = next(u.path for u in fit.structure.free_parameters if u.name == "level")
    ends = edge_intervals(fitter, fit, {u.path: (level, level) for u in fit.structure.free_parameters})[path]
    drives = np.concatenate([r.drive[:, 0] for r in fitter.fit_records])
    within = np.abs(drives[(drives * level > 0) & (np.abs(drives) < 0.999 * abs(level))]).max()
    inner, outer = sorted(map(abs, ends))
    # the softness of the limit, a ten thousandth of it, is beside both
    assert inner == pytest.approx(within, abs=2e-3 * abs(level)) and outer == pytest.approx(abs(level), rel=2e-3)
    assert ends[0] <= level <= ends[1] and ends[0] * ends[1] > 0


@pytest.mark.exhaustive
def test_intervals_of_ends_hold_those_of_the_independent_plant():
    """One case of each law that is not of its own form there; docs/evidence/concealed_cases.md counts more of them."""
    for name in ("friction_there", "friction_from", "damping_fast", "knee"):
        assert found(name, 1).covered == (True,), name


@pytest.mark.parametrize(
    "kind, key",
    [
        ("coulomb_after", ("time", None, 0)),
        ("temperature_sensitivity_above", ("temperature", None, 0)),
        ("coulomb_above", ("position", Place.FORCE, 1)),
        ("backlash_above", ("position", Place.FORCE, 1)),
        ("viscous_at_speed", ("speed", Place.FORCE, 1)),
        ("coulomb", None),
        ("parameter", None),
    ],
)
def test_a_region_lies_along_what_its_own_axis_does_or_along_what_all_share(kind, key):
    """Time and temperature are of no axis; what acts on a displacement lies along the way of the axis that a force acts on."""
    motion = {
        (quantity, place, i): np.array([i])
        for quantity, place in (
            ("time", None),
            ("temperature", None),
            ("position", Place.FORCE),
            ("position", Place.SENSOR),
            ("speed", Place.FORCE),
        )
        for i in range(2)
    }
    cause = SimpleNamespace(effect=kind, law=Effect.library.get(kind), acts_on=lambda device: [1])
    fit = SimpleNamespace(structure=SimpleNamespace(causes=(cause,), device=None))
    assert along_region(motion, fit, 0) is (motion[key] if key else None)


@pytest.mark.parametrize(
    "law, middle, length, there",
    [
        ("coulomb_on_stretch", 0.0, 0.5, True),
        ("coulomb_on_stretch", 0.9, 0.5, False),
        ("local_error", 0.9, 0.5, True),
        ("local_error", 0.9, 1e-4, False),
    ],
)
def test_a_force_on_a_stretch_that_ends_beyond_all_that_was_recorded_is_that_beyond_an_edge(law, middle, length, there):
    """A reading that is off at the end of its scale has no law of one edge."""
    cause = Hypothesis(law, "sensor:axis" if law == "local_error" else "stage:axis", "axis")
    values = {"position": middle, "length": length}
    fit = SimpleNamespace(structure=SimpleNamespace(causes=(cause,), device=AXIS), values=lambda k: values)
    motion = {("position", place, 0): np.linspace(-1, 1, 1001) for place in (Place.FORCE, Place.SENSOR)}
    assert (no_region(motion, fit, 0) is None) == there
