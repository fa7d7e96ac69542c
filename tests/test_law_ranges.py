"""The ranges that a law's record gives for its numbers."""

from __future__ import annotations

import numpy as np
import pytest

from ctrlgen.effects import Effect
from ctrlgen.estimation.priors import prior_of

PARAMETERS = [(kind, p, prior_of(law).of(p)) for kind, law in Effect.library.items() for p in law.params]
every_parameter = pytest.mark.parametrize(
    "kind, p, prior", PARAMETERS, ids=[f"{kind}-{p.name}" for kind, p, _ in PARAMETERS]
)
# Shares of something that there is by itself once; a metal's resistance, and the loss of what is hot, which rise
ONE_WAY = {
    "finite_rotation": (-2.0, 4.0),
    "link_load": (-2.0, 4.0),
    "amplifier_lag": (-0.5, 1.5),
    "low_pass": (-0.5, 1.5),
    "soft_coupling": (-0.5, 1.5),
    "coil_heating": (-0.1, 1.0),
    "heater_resistance": (-1e-3, 1e-2),
    "heater_resistance_of_second_order": (-1e-3, 1e-2),
    "heat_loss": (-1e-3, 1e-2),
}


@pytest.mark.parametrize("law", Effect.library.values(), ids=Effect.library)
def test_an_amplitude_goes_as_far_either_way_or_one_way_alone(law):
    """No sign of what was left out is likelier than the other; it is off at zero."""
    p = law.amplitude()
    low, high = p.bounds
    assert p.off == 0.0 and (low == 0.0 or (low, high) == ONE_WAY.get(law.kind, (-high, high)))


@every_parameter
def test_what_is_tried_lies_inside_the_bounds_and_rises_or_falls(kind, p, prior):
    low, high = p.bounds
    assert low < high and all(low <= value <= high for value in prior.start_values)
    steps = np.sign(np.diff(prior.start_values))
    assert len(set(steps)) <= 1


@every_parameter
def test_what_is_expected_or_usual_lies_inside_the_bounds_around_its_middle(kind, p, prior):
    for ends in (prior.fixed_range, prior.plausible_range):
        if ends:
            assert p.bounds[0] <= ends[0] < ends[1] <= p.bounds[1]
            assert sum(ends) / 2 == pytest.approx(1.0)  # of a whole: it is so, or it is not


@every_parameter
def test_times_frequencies_and_ways_are_not_negative_and_moments_places_and_leans_may_be(kind, p, prior):
    if p.off is None:
        either = p.name in (
            "moment",
            "position",
            "reference",
            "phase",
            "lean",
            "centre",
            "gap",
            "edge",
            "level",
            "linear",
            "exponent",
            "curvature",
            "taper",
            "reversible",
            "skew",
            "excess",
            "grid",
            "wear",
            "sine",
            "cosine",
            "upper",
            "lower",
            "side",
            "low",
            *(f"c{j}" for j in range(1, 18)),
        )
        assert either or p.bounds[0] >= 0.0


@pytest.mark.parametrize("law", Effect.library.values(), ids=Effect.library)
def test_a_memory_has_a_typical_size_and_a_way_over_which_it_settles_may_be_a_hundredth_of_the_travel(law):
    assert all(state.scale > 0 for state in law.states)
    reach = [p for p in law.params if p.name == "reach" and p.unit == "travel"]
    assert all(p.bounds[0] <= 0.01 for p in reach)


def test_what_bends_or_moves_a_scale_acts_before_the_fringes_are_counted_along_it_in_the_order_of_the_file():
    orders = {Effect.library[kind].order for kind in ("bow", "cubic_sensor", "drift", "temperature_sensitivity")}
    assert len(orders) == 1 and max(orders) < Effect.library["cyclic"].order


def test_the_laws_of_two_channels_and_those_with_a_clock_are_these():
    """A law of two channels is tried with every partner; a clock counts on through a record and between records."""
    library = Effect.library.items()
    couplings = {"stiffness_coupling", "damping_coupling", "inertia_coupling"}
    empirical = {"empirical_history", "empirical_position", "empirical_speed"}
    two = (
        {
            "abbe_arm",
            "arcuate_motion",
            "coupling",
            "cross_scale",
            "drive_crosstalk",
            "feedthrough",
            "link_compliance",
            "squareness",
            "swapped",
            "waviness",
        }
        | couplings
        | empirical
    )
    mirrors = {"autocollimator", "face_tilt", "mirror_tilt"}
    assert {k for k, law in library if law.pairs} == two | mirrors
    finer = {"weighted_displacement_hysteresis", "weighted_drive_hysteresis"}
    finer |= {"power_creep", "bouc_wen_of_power", "displacement_bouc_wen_of_power"}
    finer |= {
        "moving_average",
        "cogging_of_slots",
        "worn_backlash",
        "stribeck_above",
        "stribeck_after",
        "stribeck_below",
    }
    assert {k for k, law in library if not prior_of(law).suspected} == empirical | finer | mirrors | {
        "plane_mirror",
    }
    clocked = {
        "coulomb_after",
        "degradation",
        "drift",
        "force_step",
        "lost_beams",
        "sensor_step",
        "stiffness_drift",
        "stribeck_after",
        "vibration",
        "vibration_per_record",
        "warm_up",
        "drift_per_record",
        "sensor_step_per_record",
    }
    assert {k for k, law in library if any(s.clock for s in law.states)} == clocked
