"""The table of what the search believes of each law: it fits the laws, and a law without a row is found all the same."""

from __future__ import annotations

import pytest

from ctrlgen.effects import Effect, Param, Side
from ctrlgen.estimation.law_prior import LawPrior, default_starts
from ctrlgen.estimation.priors import DEFAULT, PRIORS, prior_of

STARTS_FROM_DATA = (
    *("", "spatial_periods", "drive_levels", "jump_positions", "moments", "middles", "lengths"),
    *("edges_above", "edges_below", "edges_outward", "edges_beyond", "speeds", "drives", "since", "warmer"),
    *("reading_ends", "periods_across"),
)
every_law = pytest.mark.parametrize("law", Effect.library.values(), ids=Effect.library)


def test_every_row_is_of_a_law_and_has_a_reason():
    assert set(PRIORS) <= set(Effect.library)
    assert all(row.reason for row in PRIORS.values())


@every_law
def test_a_row_names_parameters_of_its_law(law):
    assert set(prior_of(law).parameters) <= {p.name for p in law.params}


@every_law
def test_a_shape_parameter_has_somewhere_to_start_inside_its_bounds(law):
    for p in law.params:
        prior = prior_of(law).of(p)
        assert p.off is not None or prior.start_values or prior.start_from_data
        assert all(p.bounds[0] <= value <= p.bounds[1] for value in prior.start_values)
        assert prior.start_from_data in STARTS_FROM_DATA


@every_law
def test_every_shape_states_what_the_law_is_at_its_bounds(law):
    """A law that is never suspected ends at none."""
    prior = prior_of(law)
    shapes = {p.name for p in law.params if p.off is None}
    wanted = shapes if prior.suspected or prior.refines else set()
    open_, needless = sorted(wanted - set(law.at_bounds)), sorted(set(law.at_bounds) - wanted)
    told = f"state in at_bounds what {law.kind} is where these end at a bound, itself(...) if still itself"
    assert not open_, f"{told}: {', '.join(open_)}"
    assert not needless, f"{law.kind} states what is no shape of a suspected law: {', '.join(needless)}"


def test_a_law_in_a_region_is_that_of_everywhere_where_its_edge_leaves_all_of_the_motion_inside():
    """Above an edge that lies lowest, below one that lies highest, beyond one that is narrowest; an event in time is none."""
    told = set()
    for kind, law in Effect.library.items():
        ends = law.acts_in and law.at_bounds.get(law.acts_in.at)
        if ends and (ends.low or ends.high):
            told.add(kind)
            assert bool(ends.high) == (law.acts_in.side is Side.BELOW) != bool(ends.low), kind
    assert {"coulomb_above", "coulomb_below", "stiffness_above", "stiffness_below", "stiffness_beyond"} < told


@every_law
def test_only_an_amplitude_is_fixed_or_limited_to_what_is_plausible(law):
    for p in law.params:
        prior = prior_of(law).of(p)
        for low, high in filter(None, (prior.fixed_range, prior.plausible_range)):
            assert p is law.amplitude()
            assert p.bounds[0] <= low < high <= p.bounds[1]


def test_a_law_without_a_row_starts_at_three_values_spread_over_the_bounds():
    time = Param("tau", "s", (1e-3, 1e3), "time constant")
    assert DEFAULT.of(time).start_values == pytest.approx((1e-2, 1.0, 1e2))
    skew = Param("skew", "1", (-3.0, 3.0), "to one side")
    assert default_starts(skew) == pytest.approx((-2.0, 0.0, 2.0))
    assert default_starts(Param("gain", "1", (-1.0, 1.0), "amplitude", off=0.0)) == ()


def test_a_law_without_a_row_has_even_odds_and_an_exact_form():
    class Unlisted(Effect, listed=False):
        params = (Param("gain", "1", (-1.0, 1.0), "amplitude", off=0.0),)

    assert prior_of(Unlisted) == LawPrior()
    assert (DEFAULT.log_prior_odds, DEFAULT.model_form_error, DEFAULT.form_of) == (0.0, 0.0, None)
