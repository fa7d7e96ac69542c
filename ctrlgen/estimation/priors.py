"""What the search believes of each law before it sees a recording: one row a law, each with its reason.

A law's own file in `ctrlgen/effects/` states physics. Here stands what inference adds to it: how common the law is, how far
its form may be from nature, and where a fit of its parameters may start. A law without a row gets the defaults of `LawPrior`
and `ParameterPrior`, so adding a law needs no row; add one where a default is wrong. "Judgement" marks a number that was set
by judgement and has no measurement or source behind it; such numbers were checked on simulated recordings with known causes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from ctrlgen.devices.usual_deviation import ASSUMED_SCALE
from ctrlgen.effects import Effect
from ctrlgen.estimation.law_prior import (
    ACROSS,
    CREEPING,
    LEVELLING_OFF,
    ONE_IN_TEN,
    LawPrior,
    ParameterPrior,
    peaks,
)
from ctrlgen.estimation.priors_in_a_region import IN_A_REGION
from ctrlgen.estimation.priors_of_a_lag import HYSTERESIS, OF_A_LAG
from ctrlgen.estimation.priors_of_drives import OF_DRIVES
from ctrlgen.estimation.priors_of_filters import OF_FILTERS
from ctrlgen.estimation.priors_of_heat import OF_HEAT
from ctrlgen.estimation.priors_of_stops import OF_STOPS
from ctrlgen.estimation.priors_of_time import OF_TIME


def prior_of(law: type[Effect]) -> LawPrior:
    """The row of a law; of one of another package what it states itself; or the default."""
    return PRIORS.get(law.kind) or (law.prior if isinstance(law.prior, LawPrior) else DEFAULT)


DEFAULT = LawPrior()
_starts = ParameterPrior  # shorthand: _starts((0.1, 1.0)) is a parameter with these start values alone

_LOOP = ParameterPrior((0.01, 0.03, 0.1, 0.3, 1.0))
_DRY_FRICTION = "Forms of one contact. Measured friction differs by a few per cent from any of them; 2 % is judgement."
_IN_BALANCE = (
    " In a stage in balance a force that lags and a displacement that lags show the same to first order; there the latter is "
    "suspected, whose memory stays out of the balance."
)
_CREEP = "Forms of one relaxation spectrum; 1 %: judgement."

_COGGING = LawPrior(
    "Motors of a stage that is no flexure have it; harmonics: several at one place. Periods seen in the residual.",
    repeatable=True,
    parameters={
        "period": ParameterPrior((1.0, 0.5, 0.25), start_from_data="spatial_periods"),
        "phase": _starts((0.0, 90.0)),
    },
)
_CYCLIC = LawPrior(
    "Harmonics: several at one place. Periods from a twentieth of the typical size to twice it, and those seen in the residual.",
    form_of="cyclic error",
    repeatable=True,
    period_up_to=2.0,
    parameters={
        "period": ParameterPrior(
            (2.0, 4 / 3, 1.0, 2 / 3, 0.5, 1 / 3, 0.25, 1 / 6, 0.125, 0.1, 0.05),
            start_from_data="spatial_periods",
        ),
        "phase": _starts((0.0, 90.0)),
    },
)
_PLAY = LawPrior(
    "Reversals between two samples are placed to 1 %: measured on simulated play.",
    model_form_error=0.01,
    parameters={"gap": peaks(1e-4, 1e-3, 0.01, 0.1, 0.3)},
)

PRIORS: Mapping[str, LawPrior] = MappingProxyType(
    {
        # Sensor ---------------------------------------------------------------------------------------------------------------
        "bow": LawPrior("No sensor is bent by its first even term alone; 5 %: judgement.", model_form_error=0.05),
        "cyclic": _CYCLIC,
        "cyclic_from_home": replace(
            _CYCLIC,
            reason="Where the readings do not tell which of the two it is, the plain one is named: judgement. "
            + _CYCLIC.reason,
            log_prior_odds=-1.0,
        ),
        "clock_offset": LawPrior(
            "One pair of recorders for all readings; rarer than a late reading, which is named first: judgement.",
            log_prior_odds=ONE_IN_TEN,
            acts_on_all=True,
            domain="recording",
        ),
        "delay": LawPrior(
            "Error of the interpolation between samples; 0.1 %: judgement. One recorder, or the dead time of the drive, is late for all.",
            model_form_error=0.001,
            of_one_reference=True,
        ),
        "eccentricity": LawPrior(
            "Within a part of a turn it is a gain and a bow. With a wrong phase it explains little of a turn or two: every 30 deg.",
            once_a_turn=True,
            parameters={"phase": _starts((0.0, 30.0, 60.0, 90.0, 120.0, 150.0))},
        ),
        "feedthrough": LawPrior(
            "Shields and grounds are made against it: rarer than a wrong gain, which it is where the stage follows its drive at once. "
            "Judgement.",
            log_prior_odds=ONE_IN_TEN,
            unless=frozenset({"balanced"}),
            parameters={"before": _starts((0.5,))},
        ),
        "home_offset": LawPrior(
            "Readings are zeroed before a run, and an offset fits the mean of any residual of one sign, as of friction in one "
            "direction: judgement.",
            log_prior_odds=ONE_IN_TEN,
            constant=True,
        ),
        "quantisation": LawPrior(
            "Steps of half a decade each, from 1e-4 to 0.1 of the typical size.",
            parameters={"quantum": _starts((1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1))},
        ),
        "rectified": LawPrior(
            "A fault of wiring or software; a small one is a curve of the sensor or a gain that differs by direction: judgement.",
            log_prior_odds=ONE_IN_TEN,
            parameters={"share": ParameterPrior(plausible_range=(0.4, 1.6))},
        ),
        "sensor_gain": LawPrior(
            "As common as a wrong gain of the drive. Channels that one reference serves, a wavelength or the magnification of a "
            "camera, are off together.",
            of_one_reference=True,
            parameters={"gain": ParameterPrior(deviation=ASSUMED_SCALE)},
        ),
        "sensor_limit": LawPrior(
            "A range is chosen for what is to be read, and an end of it that is reached is mostly seen: judgement. A sensor is at its "
            "end or it is not.",
            log_prior_odds=ONE_IN_TEN,
            parameters={
                "share": ParameterPrior(fixed_range=(0.5, 1.5)),
                "level": ParameterPrior(start_from_data="reading_ends", only_from_data=True),
            },
        ),
        "sensor_saturation": LawPrior(
            "A sensor's curve is first of all a cubic, and drives level off more often: judgement. Its form: as `soft_saturation`.",
            log_prior_odds=ONE_IN_TEN,
            model_form_error=0.01,
            parameters=LEVELLING_OFF,
        ),
        "stitching_error": LawPrior(
            "Rarer than errors that act along the whole path: judgement. A scale may have several joints.",
            log_prior_odds=-1.0,
            repeatable=True,
            parameters={
                "position": ParameterPrior(start_from_data="jump_positions"),
                "width": _starts((0.005, 0.03)),
            },
        ),
        "stuck": LawPrior(
            "A dead channel is rarer than a wrong gain: judgement. A channel is dead or it is not.",
            log_prior_odds=ONE_IN_TEN,
            parameters={"share": ParameterPrior(fixed_range=(0.8, 1.2)), "level": _starts((0.0, 1.0))},
        ),
        "temperature_sensitivity": LawPrior(
            "Right at the rise at which home was set, unless the fit says otherwise.",
            parameters={"reference": _starts((0.0,))},
        ),
        "gain_of_temperature": LawPrior("As common as another gain, where a temperature was recorded: judgement."),
        "scale_of_temperature": LawPrior("As common as another scale, where a temperature was recorded: judgement."),
        "stiffness_of_temperature": LawPrior("In balance it is `gain_of_temperature`.", unless=frozenset({"balanced"})),
        "zero_per_record": LawPrior(
            "Sensors are zeroed anew, or drift, between runs; but zeros fit the mean of whatever is missing: judgement.",
            log_prior_odds=ONE_IN_TEN,
            constant=True,
            of_each_record=True,
            parameters={"share": ParameterPrior(fixed_range=(0.8, 1.2))},
        ),
        **OF_FILTERS,
        **OF_DRIVES,
        # Force ----------------------------------------------------------------------------------------------------------------
        "asymmetric_hysteresis": LawPrior(
            "Rarer than a symmetric loop: judgement. " + HYSTERESIS + _IN_BALANCE,
            log_prior_odds=ONE_IN_TEN,
            unless=frozenset({"balanced"}),
            model_form_error=0.02,
            form_of="hysteresis",
            parameters={"reach": _LOOP, "skew": _starts((-0.6, 0.6))},
        ),
        "bouc_wen": LawPrior(
            HYSTERESIS + _IN_BALANCE,
            unless=frozenset({"balanced"}),
            model_form_error=0.02,
            form_of="hysteresis",
            parameters={"reach": _LOOP, "loop": _starts((0.55, 0.9))},
        ),
        "bouc_wen_of_power": LawPrior(
            "A finer form of a smooth loop that is found, for a knee that is no exponential; 2 %: as of any loop.",
            suspected=False,
            refines=frozenset({"bouc_wen", "hysteresis"}),
            model_form_error=0.02,
            form_of="hysteresis",
            parameters={"reach": _LOOP, "loop": _starts((0.55, 0.9)), "power": _starts((1.5,))},
        ),
        "cogging": _COGGING,
        "cogging_from_home": replace(
            _COGGING,
            reason="Where the readings do not tell which of the two it is, the plain one is named: judgement. "
            + _COGGING.reason,
            log_prior_odds=-1.0,
        ),
        "cogging_of_slots": replace(
            _COGGING,
            suspected=False,
            refines=frozenset({"cogging"}),
            parameters={**_COGGING.parameters, **dict.fromkeys(("sine", "cosine"), _starts((0.0,)))},
        ),
        "coulomb": LawPrior(
            _DRY_FRICTION,
            model_form_error=0.02,
            form_of="dry friction",
            parameters={"reach": peaks(3e-4, 3e-3, 0.03), "smoothing": CREEPING},
        ),
        **IN_A_REGION,
        **OF_HEAT,
        **OF_TIME,
        **OF_A_LAG,
        "directional_friction": LawPrior(
            "Dry friction alike in both directions is commoner: judgement. " + _DRY_FRICTION,
            log_prior_odds=-1.0,
            model_form_error=0.02,
            form_of="dry friction",
            parameters={"skew": _starts((-0.3, 0.3)), "reach": peaks(3e-4, 3e-3, 0.03)},
        ),
        "eddy_current_brake": LawPrior(
            "Grease and dry friction are commoner. Conductors are no thin sheets and poles have edges, grease follows other powers: 2 %. "
            "Judgement. Beside dry friction a force that falls with the speed is Stribeck's.",
            log_prior_odds=ONE_IN_TEN,
            model_form_error=0.02,
            form_of="dry friction",
            parameters={"speed": peaks(0.05, 0.2, 0.7)},
        ),
        **OF_STOPS,
        "force_factor": LawPrior(
            "Higher orders of the force factor; 2 %: judgement. A coil is in the middle of its gap, or off it by as much as is usual.",
            model_form_error=0.02,
            parameters={"centre": ParameterPrior((-0.3, 0.0, 0.3), usual=0.0)},
        ),
        "gravity": LawPrior(
            "Hanging, upright or out to either side.", parameters={"phase": _starts((-90.0, 0.0, 90.0, 180.0))}
        ),
        "hysteresis": LawPrior(
            HYSTERESIS + _IN_BALANCE,
            unless=frozenset({"balanced"}),
            model_form_error=0.02,
            form_of="hysteresis",
            parameters={"reach": replace(_LOOP, start_values=(0.03, 0.1, 0.3, 1.0, 2.0)), "taper": _starts((0.5,))},
        ),
        "one_sided_stiffening": LawPrior(
            "A flexure that is straight at home stiffens alike to both sides: rarer than that. Judgement.",
            log_prior_odds=-1.0,
        ),
        "resonance": LawPrior(
            "A payload has more than one mode; 1 %: judgement. Octaves of frequency, lightly and well damped.",
            model_form_error=0.01,
            parameters={"frequency": _starts((10.0, 20.0, 40.0, 80.0, 160.0, 320.0)), "damping": _starts((0.02, 0.2))},
        ),
        "slack_friction": LawPrior(
            "Friction without a slack before it is commoner: judgement. " + HYSTERESIS + _IN_BALANCE,
            log_prior_odds=-1.0,
            unless=frozenset({"balanced"}),
            model_form_error=0.02,
            form_of="hysteresis",
            parameters={"slack": peaks(0.1, 0.3, 0.6), "reach": peaks(0.03, 0.1, 0.3)},
        ),
        "friction_of_load": LawPrior(
            "Dry friction that is the same under every load is commoner: judgement. " + _DRY_FRICTION,
            log_prior_odds=-1.0,
            model_form_error=0.05,
            form_of="dry friction",
            refines=frozenset({"coulomb"}),
            parameters={"reach": peaks(1e-3, 0.01), "smoothing": CREEPING, "load": peaks(0.1, 1.0)},
        ),
        "stribeck": LawPrior(
            "Dry friction that does not fall with speed is commoner: judgement. " + _DRY_FRICTION,
            log_prior_odds=-1.0,
            model_form_error=0.02,
            form_of="dry friction",
            parameters={"breakaway": _starts((1.8,)), "speed": peaks(0.01, 0.05, 0.2), "reach": peaks(1e-3, 0.01)},
        ),
        # Displacement and pose ------------------------------------------------------------------------------------------------
        "backlash": _PLAY,
        "worn_backlash": replace(
            _PLAY,
            suspected=False,
            refines=frozenset({"backlash", "backlash_above", "backlash_below"}),
            parameters={**_PLAY.parameters, "wear": _starts((-0.3, 0.3)), "spread": peaks(0.3, 1.0)},
        ),
        "creep": LawPrior(
            _CREEP,
            model_form_error=0.01,
            form_of="creep",
            parameters={"tau": _starts((0.03, 0.3, 3.0, 30.0, 300.0)), "slow": _starts((0.0, 0.25))},
        ),
        "finite_rotation": LawPrior("One geometry for all components.", acts_on_all=True),
        "lever_ratio": LawPrior(
            "Explains nearly the same as a gain of the drive, which is named first: judgement; where the drive is a displacement, just "
            "the same.",
            log_prior_odds=ONE_IN_TEN,
            unless=frozenset({"displacement_command"}),
        ),
        "link_load": LawPrior("One mechanism loads all stages.", acts_on_all=True),
        "log_creep": LawPrior(
            _CREEP,
            model_form_error=0.01,
            form_of="creep",
            parameters={"tau": _starts((0.01, 0.1, 1.0)), "decades": _starts((3.25, 6.0))},
        ),
        "power_creep": LawPrior(
            _CREEP,
            model_form_error=0.01,
            form_of="creep",
            suspected=False,
            refines=frozenset({"creep", "log_creep"}),
            parameters={"tau": _starts((0.01, 0.1)), "decades": _starts((6.0,)), "exponent": _starts((-0.2, 0.3))},
        ),
        "lost_motion": LawPrior(
            "On a stage of constant stiffness the same as a gain of the drive, which is named first: judgement.",
            log_prior_odds=ONE_IN_TEN,
        ),
        "payload": LawPrior(
            "Upright, or hanging out sideways. Of small angles the same as a scale of the sensor, which is named first: judgement.",
            log_prior_odds=ONE_IN_TEN,
            parameters={"share": ParameterPrior(deviation=ASSUMED_SCALE), "lean": _starts((0.0, 90.0))},
        ),
        **dict.fromkeys(
            (f"frame_rotation_{axis}" for axis in "xyz"),
            LawPrior(
                "A rigid platform stands turned as a whole; instruments of angles may be turned otherwise than those of ways.",
                of_one_body=True,
            ),
        ),
        "arcuate_motion": LawPrior(
            "Every guide on leaf springs has it. Of a pose of six components the mechanism's own kinematics say as much.",
            unless=frozenset({"spatial"}),
        ),
        "waviness": LawPrior(
            "Guides of balls and screws have it. Harmonics: several at one place. Not of a pose of six components. Judgement.",
            log_prior_odds=ONE_IN_TEN,
            repeatable=True,
            unless=frozenset({"spatial"}),
            parameters={
                "period": ParameterPrior(start_from_data=ACROSS, only_from_data=True),
                "phase": _starts((0.0, 90.0)),
            },
        ),
        "cross_scale": LawPrior(
            "Rarer than axes that are not square: judgement. Of a pose of six components finite rotations say as much.",
            log_prior_odds=ONE_IN_TEN,
            unless=frozenset({"spatial"}),
        ),
        "squareness": LawPrior(
            "Of a pose of six components a frame that stands turned in one reading says the same.",
            unless=frozenset({"spatial"}),
        ),
        # Empirical: written where no law reaches what is left, never suspected ---------------------------------------------------
        **dict.fromkeys(
            ("empirical_history", "empirical_position", "empirical_speed"),
            LawPrior(
                "A smoother of what no law reaches: `shares.empirical_terms` gives it its numbers.", suspected=False
            ),
        ),
        # Stated of an instrument, never suspected: what they add is that of `frame_rotation_x` and the like, which are --------------
        **dict.fromkeys(
            ("autocollimator", "face_tilt", "mirror_tilt", "plane_mirror"),
            LawPrior(
                "Known of the set-up, or bounded by the instrument's maker; readings alone cannot tell it from a turned frame or from "
                "finite rotations of the platform.",
                suspected=False,
            ),
        ),
        # One amplitude and no shape: the default ------------------------------------------------------------------------------
        **dict.fromkeys(
            (
                "abbe_arm",
                "asymmetric_viscous",
                "coupling",
                "cubic_sensor",
                *(f"{what}_coupling" for what in ("damping", "inertia", "stiffness")),
                "drive_gain",
                "expansion",
                "heat_crosstalk",
                "link_compliance",
                "quadratic_damping",
                "raised_point",
                "screw_motion",
                "stiffening",
                "stiffness",
            ),
            DEFAULT,
        ),
    }
)
