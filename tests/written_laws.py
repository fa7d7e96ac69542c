"""Every law's term and rates, written out in numpy from the equation of its record."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from numpy import abs, arctan, cos, cross, exp, sign, sin, sqrt
from written_terms import (
    EVENT,
    PARTS,
    SIDES,
    TWO_PI,
    WEIGHTS,
    H,
    bends,
    beyond,
    buffer,
    clipped,
    collimated,
    dahl_rate,
    dead,
    event,
    gripping,
    heavy_narrow,
    logarithmic,
    lost,
    lugre_rate,
    met,
    on_stretch,
    past,
    powered,
    ramp,
    remembered,
    risen,
    second_mass,
    second_mass_rates,
    slewed,
    stop,
    too_fast,
    turned,
    weighted,
)

import ctrlgen.effects  # noqa: F401  fills the library
from ctrlgen.effects import Effect

LAWS = {
    "abbe_arm": ({}, lambda s, p: p.arm * s.all[s.partner]),
    **dict.fromkeys(
        ("asymmetric_displacement_hysteresis", "asymmetric_drive_hysteresis"),
        (
            {"reach": 0.3, "taper": 0.5, "reversible": 0.7, "upper": 0.4, "lower": -0.2, "side": 0.1},
            lambda s, p: -p.share * (weighted(s, p, s.value) - 0.7 * s.value),
        ),
    ),
    "autocollimator": ({}, collimated),
    "asymmetric_gain": ({}, lambda s, p: p.gain * abs(s.value)),
    "asymmetric_hysteresis": (
        {"reach": 0.3, "skew": 0.6},
        lambda s, p: -p.stiffness * s.z * (1 + p.skew * s.displacement / np.hypot(s.displacement, s.travel)),
    ),
    "asymmetric_viscous": ({}, lambda s, p: -abs(p.damping) * max(s.velocity * sign(p.damping), 0) * sign(p.damping)),
    "backlash": ({}, lambda s, p: 0.999 * (s.w + s.start * p.gap / 2 - s.displacement)),
    "bouc_wen": ({"reach": 0.3, "loop": 0.8}, lambda s, p: -p.stiffness * s.z),
    "bouc_wen_of_power": ({"reach": 0.3, "loop": 0.8, "power": 1.5}, lambda s, p: -p.stiffness * s.z),
    "bow": ({}, lambda s, p: p.curvature * s.value**2),
    "clock_offset": None,  # below: it shifts the recorded drive
    "cogging": (
        {"period": 0.4, "phase": 0.9},
        lambda s, p: -p.force * sin(TWO_PI * s.displacement / 0.4 + 0.9),
    ),
    "cogging_from_home": (
        {"period": 0.4, "phase": 0.9},
        lambda s, p: -p.force * (sin(TWO_PI * s.displacement / 0.4 + 0.9) - sin(0.9)),
    ),
    "cogging_of_slots": (
        {"period": 0.4, "phase": 0.9, "sine": 0.2, "cosine": -0.1},
        lambda s, p: (
            -p.force * (sin(s_ := TWO_PI * s.displacement / 0.4 + 0.9) + 0.2 * sin(2 * s_) - 0.1 * cos(2 * s_))
        ),
    ),
    "eddy_current_brake": (
        {"speed": 0.4},
        lambda s, p: -2 * (p.damping * 0.4 / 2) * sign(s.velocity) / (abs(s.velocity) / 0.4 + 0.4 / abs(s.velocity)),
    ),
    "eccentricity": ({"phase": 0.9}, lambda s, p: p.amplitude * (sin(s.value + 0.9) - sin(0.9))),
    "drive_crosstalk": ({}, lambda s, p: p.share * s.all[s.partner]),
    "feedthrough": ({"before": 0.3}, lambda s, p: p.gain * (0.7 * s.drives[s.partner] + 0.3 * s.before)),
    "force_factor": ({"centre": 0.2}, lambda s, p: -p.fall * (s.displacement - 0.2) ** 2 * s.value),
    "gravity": ({"phase": 0.9}, lambda s, p: -p.torque * sin(s.displacement + 0.9)),
    "coulomb": ({"reach": 0.02, "smoothing": 0.3}, lambda s, p: -p.force * s.z, lambda s, p: {"z": dahl_rate(s, p)}),
    **{
        f"coulomb_{side}": (
            {"reach": 0.02, "smoothing": 0.3, "edge": 0.2, "width": 0.3},
            lambda s, p, sign=sign: -p.force * s.z * past(s, p, sign),
            lambda s, p: {"z": dahl_rate(s, p)},
        )
        for side, sign in SIDES.items()
    },
    "coulomb_after": (
        {"reach": 0.02, "smoothing": 0.3, **EVENT},
        lambda s, p: -p.force * s.z * event(s, p),
        lambda s, p: {"z": dahl_rate(s, p)},
    ),
    **{
        f"viscous_{side}": (
            {"edge": 0.2, "width": 0.3},
            lambda s, p, sign=sign: -p.damping * s.velocity * past(s, p, sign),
        )
        for side, sign in SIDES.items()
    },
    "coulomb_on_stretch": (
        {"reach": 0.02, "smoothing": 0.3, "position": 0.2, "length": 0.5, "width": 0.3},
        lambda s, p: -p.force * s.z * on_stretch(s),
        lambda s, p: {"z": dahl_rate(s, p)},
    ),
    "viscous_on_stretch": (
        {"position": 0.2, "length": 0.5, "width": 0.3},
        lambda s, p: -p.damping * s.velocity * on_stretch(s),
    ),
    "viscous_at_speed": ({"speed": 0.1}, too_fast),
    **{
        f"stiffness_{side}": (
            {"edge": 0.2},
            lambda s, p, sign=sign: -sign * p.stiffness * ramp(sign * (s.displacement - 0.2), 1e-6 * s.travel),
        )
        for side, sign in SIDES.items()
    },
    **{
        f"backlash_{side}": (
            {"edge": 0.2, "width": 0.3},
            lambda s, p: 0.999 * (s.w + s.start * p.gap / 2 - s.displacement),
        )
        for side in SIDES
    },
    "stiffness_beyond": (
        {"edge": 0.2},
        lambda s, p: -p.stiffness * sign(s.displacement) * ramp(abs(s.displacement) - 0.2, 1e-6 * s.travel),
    ),
    "drive_gain_beyond": (
        {"level": 0.2},
        lambda s, p: p.gain * sign(s.value) * ramp(abs(s.value) - 0.2, 2e-4),
    ),
    "local_error": (
        {"position": 0.2, "length": 0.3, "rounding": 0.4},
        lambda s, p: (
            p.error
            * (beyond(s.value - 0.05, 0.4) - beyond(s.value - 0.35, 0.4))
            / (beyond(0.15, 0.4) - beyond(-0.15, 0.4))
        ),
    ),
    "temperature_sensitivity_above": ({"reference": 0.2}, lambda s, p: p.slope * max(s.ambient - 0.2, 0.0)),
    "butterfly": (
        {"linear": 0.6, "reach": 0.3, "taper": 0.5},
        lambda s, p: p.share * (((s.value - weighted(s, p, s.value)) / risen(s.scale)) ** 2 * s.scale - 0.6 * s.value),
    ),
    "coupling": ({}, lambda s, p: p.gain * s.all[s.partner]),
    "damping_coupling": ({}, lambda s, p: -p.damping * s.velocities[s.partner]),
    "inertia_coupling": ({}, lambda s, p: -p.inertia * s.accelerations[s.partner]),
    "one_sided_stiffening": ({}, lambda s, p: -p.k2 * s.displacement**2),
    "stiffness_coupling": ({}, lambda s, p: -p.stiffness * s.displacements[s.partner]),
    "creep": (
        {"tau": 0.3, "slow": 0.2},
        lambda s, p: p.gain * (0.8 * s.z + 0.2 * s.w),
        lambda s, p: {"z": (s.value - s.z) / 0.3, "w": (s.value - s.w) / 1.2},
    ),
    "cubic_drive": ({}, lambda s, p: p.curvature * s.value**3),
    "cubic_sensor": ({}, lambda s, p: p.curvature * s.value**3),
    "cyclic_from_home": (
        {"period": 0.4, "phase": 0.9},
        lambda s, p: p.amplitude * (sin(TWO_PI * s.value / 0.4 + 0.9) - sin(0.9)),
    ),
    "cyclic": ({"period": 0.4, "phase": 0.9}, lambda s, p: p.amplitude * sin(TWO_PI * s.value / 0.4 + 0.9)),
    "coil_heating": (
        {"tau": 0.4},
        lambda s, p: s.value / (1 + p.rise * s.w) - s.value,
        lambda s, p: {"w": (s.value**2 / (1 + p.rise * s.w) - s.w) / 0.4},
    ),
    "dead_zone": ({"rounding": 0.3}, dead),
    "degradation": ({"levels_off": 3.0}, lambda s, p: -p.rate * 3.0 * (1 - exp(-s.t / 3.0)) * s.value),
    "delay": None,  # below: exact for the polynomials that it interpolates by
    "moving_average": None,  # tests/test_moving_average.py: exact for the polynomials whose mean it takes
    "drift": ({}, lambda s, p: p.rate * s.t),
    "drive_gain": ({}, lambda s, p: p.gain * s.value),
    "drive_hysteresis": ({"reach": 0.3, "taper": 0.5}, lambda s, p: -p.share * weighted(s, p, s.value)),
    "directional_friction": (
        {"skew": -0.4, "reach": 0.02},
        lambda s, p: -p.force * (s.z - 0.4 * s.w),
        lambda s, p: {"z": (s.velocity - abs(s.velocity) * s.z) / 0.02, "w": abs(s.velocity) * (1 - s.w) / 0.02},
    ),
    "displacement_bouc_wen": ({"reach": 0.3, "loop": 0.8}, lambda s, p: -p.share * s.z),
    "displacement_bouc_wen_of_power": ({"reach": 0.3, "loop": 0.8, "power": 1.5}, lambda s, p: -p.share * s.z),
    "displacement_hysteresis": (
        {"reach": 0.3, "taper": 0.5, "reversible": 0.7},
        lambda s, p: -p.share * (weighted(s, p, s.value) - 0.7 * s.value),
    ),
    "drive_offset": ({}, lambda s, p: p.offset),
    "empirical_history": ({"reach": 0.3, **WEIGHTS}, remembered),
    "empirical_position": (
        {"low": -0.4, "width": 0.9, **WEIGHTS},
        lambda s, p: p.size * bends((s.displacements[s.partner] + 0.4) / 0.9),
    ),
    "empirical_speed": (
        {"speed": 0.3, **WEIGHTS},
        lambda s, p: p.size * bends((1 + s.velocities[s.partner] / np.hypot(s.velocities[s.partner], 0.3)) / 2),
    ),
    "damped_stop": ({"gap": -0.4, "speed": 0.7}, buffer),
    "end_stop": ({"gap": -0.4, "power": 1.5}, stop),
    "face_tilt": ({}, lambda s, p: -p.tilt * s.all[s.partner]),
    "expansion": ({}, lambda s, p: p.slope * (s.temperature - s.temperature_at_rest) * s.value),
    "finite_rotation": ({}, lambda s, p: p.share * s.second_order_kinematics()[s.index]),
    "force_step": (EVENT, lambda s, p: p.force * event(s, p)),
    "frame_rotation_x": ({}, turned(1, 2)),
    "frame_rotation_y": ({}, turned(2, 0)),
    "frame_rotation_z": ({}, turned(0, 1)),
    "heat_crosstalk": ({}, lambda s, p: p.share * (s.all.sum() - s.value)),
    "heat_loss": ({"power": 1.6}, lost),
    "heater_resistance_of_second_order": (
        {"curvature": -0.2},
        lambda s, p: (
            s.value / np.polyval([-0.2 * p.slope, p.slope, 1], s.temperature - s.temperature_at_rest) - s.value
        ),
    ),
    "heater_resistance": ({}, lambda s, p: s.value / (1 + p.slope * (s.temperature - s.temperature_at_rest)) - s.value),
    "high_pass": ({"tau": 0.3}, lambda s, p: -p.share * s.w, lambda s, p: {"w": (s.value - s.w) / 0.3}),
    "home_offset": ({}, lambda s, p: p.offset),
    "hysteresis": ({"reach": 0.3, "taper": 0.5}, lambda s, p: -p.stiffness * weighted(s, p, s.displacement)),
    "lever_ratio": ({}, lambda s, p: p.gain * s.value),
    "link_compliance": ({}, lambda s, p: p.tilt * s.all[s.partner]),
    "link_load": ({}, lambda s, p: p.share * s.tangent_compliance()[s.index]),
    "log_creep": (
        {"tau": 0.1, "decades": 3.25},
        logarithmic,
        lambda s, p: {f"z{j}": (s.value - getattr(s, f"z{j}")) / (0.1 * sqrt(10.0) ** j) for j in range(9)},
    ),
    "power_creep": (
        {"tau": 0.1, "decades": 3.25, "exponent": 0.3},
        powered,
        lambda s, p: {f"z{j}": (s.value - getattr(s, f"z{j}")) / (0.1 * sqrt(10.0) ** j) for j in range(9)},
    ),
    "lost_beams": (EVENT, lambda s, p: -p.share * s.value * event(s, p)),
    "lost_motion": ({}, lambda s, p: -p.compliance * s.force),
    "amplifier_lag": (
        {"tau": 0.06, "damping": 0.7},
        lambda s, p: p.share * (s.w - s.value),
        lambda s, p: {"w": s.v / 0.06, "v": (s.value - s.w - 1.4 * s.v) / 0.06},
    ),
    "soft_coupling": (
        {"frequency": 8.0, "damping": 0.1},
        lambda s, p: p.share * (s.w - s.value),
        lambda s, p: {"w": 16 * np.pi * s.v, "v": 16 * np.pi * (s.value - s.w - 0.2 * s.v)},
    ),
    "low_pass": (
        {"tau": 0.06, "damping": 0.7},
        lambda s, p: p.share * (s.w - s.value),
        lambda s, p: {"w": s.v / 0.06, "v": (s.value - s.w - 1.4 * s.v) / 0.06},
    ),
    "one_sided_saturation": (
        {"level": -0.4},
        lambda s, p: p.share * (-0.4 - s.value) ** 2 / (-0.4 - s.value + 4e-5) if s.value < -0.4 else 0.0,
    ),
    "sensor_limit": (
        {"level": 0.4},
        lambda s, p: -p.share * (s.value - 0.4) ** 2 / (s.value - 0.4 + 4e-5) if s.value > 0.4 else 0.0,
    ),
    "notch": (
        {"tau": 0.06, "damping": 0.7},
        lambda s, p: -1.4 * p.share * s.v,
        lambda s, p: {"w": s.v / 0.06, "v": (s.value - s.w - 1.4 * s.v) / 0.06},
    ),
    "back_emf": (
        {"emf": 0.3, "tau": 0.06},
        lambda s, p: p.share * (s.w - s.value),
        lambda s, p: {"w": (s.value - 0.3 * s.velocity - s.w) / 0.06},
    ),
    "mirror_tilt": ({}, lambda s, p: p.tilt * s.all[s.partner]),
    "plane_mirror": ({"position": 0.4}, met),
    "payload": ({"lean": 0.4}, lambda s, p: p.share * (sin(s.value + 0.4) - sin(0.4))),
    "quadratic_damping": ({}, lambda s, p: -p.damping * s.velocity**2 * sign(s.velocity)),
    "quantisation": ({"quantum": 0.03}, lambda s, p: p.share * (0.03 * round(s.value / 0.03) - s.value)),
    "raised_point": (
        {},
        lambda s, p: cross(s.all[:3], cross(s.all[:3], [0, 0, p.height]))[s.index - 3] / 2,
    ),
    "rectified": ({}, lambda s, p: -2 * p.share * min(s.value, 0.0)),
    "resonance": ({"frequency": 8.0, "damping": 0.2}, second_mass, second_mass_rates),
    "reversed": ({}, lambda s, p: -2 * p.share * s.value),
    "saturation": ({"level": 0.4}, clipped),
    "drive_quantisation": (
        {
            "quantum": 0.03,
            "grid": 0.2,
            "rounding": 0.1,
        },  # the phasor of a wave, and 0.9 of that of each harmonic before it
        lambda s, p: -p.share * 0.03 / np.pi * np.angle(1 + 0.9 * exp(1j * TWO_PI * (s.value / 0.03 - 0.2))),
    ),
    **dict.fromkeys(
        ("soft_saturation", "sensor_saturation"),
        ({"level": 0.4, "sharpness": 2.0}, lambda s, p: p.share * (0.4 * sin(arctan(s.value / 0.4)) - s.value)),
    ),
    "slew_rate": ({"rate": 40.0}, slewed, lambda s, p: {"w": s.rise / H}),
    "asymmetric_slew_rate": ({"rate": 40.0, "excess": 0.5}, slewed, lambda s, p: {"w": s.rise / H}),
    "gain_of_temperature": ({}, lambda s, p: p.slope * s.ambient * s.value),
    "scale_of_temperature": ({}, lambda s, p: p.slope * s.ambient * s.value),
    "stiffness_of_temperature": ({}, lambda s, p: -p.slope * s.ambient * s.force),
    "screw_motion": ({}, lambda s, p: p.share * cross(s.all[:3], s.all[3:])[s.index - 3] / 2),
    "second_pole": ({"tau": 0.3}, lambda s, p: p.share * (s.w - s.value), lambda s, p: {"w": (s.value - s.w) / 0.3}),
    "sensor_gain": ({}, lambda s, p: p.gain * s.value),
    "sensor_step": (EVENT, lambda s, p: p.offset * event(s, p)),
    "sensor_step_per_record": (EVENT, lambda s, p: p.share * s.offset * event(s, p)),
    "square_drive": ({}, lambda s, p: p.curvature * s.value**2),
    "arcuate_motion": ({}, lambda s, p: p.rate * s.all[s.partner] ** 2),
    "cross_scale": ({}, lambda s, p: p.rate * s.value * s.all[s.partner]),
    "waviness": (
        {"period": 0.7, "phase": 0.4},
        lambda s, p: p.amplitude * sin(TWO_PI * s.all[s.partner] / 0.7 + 0.4),
    ),
    "squareness": ({}, lambda s, p: p.angle * s.all[s.partner]),
    "stiffening": ({}, lambda s, p: -p.k3 * s.displacement**3),
    "stiffness": ({}, lambda s, p: -p.stiffness * s.displacement),
    "stiffness_drift": ({"levels_off": 3.0}, lambda s, p: p.rate * 3.0 * (1 - exp(-s.t / 3.0)) * s.force),
    "stitching_error": (
        {"position": 0.2, "width": 0.3},
        lambda s, p: p.offset / (1 + exp(-4 * (s.value - 0.2) / 0.3)),
    ),
    "friction_of_load": (
        {"reach": 0.02, "smoothing": 0.05, "load": 0.3},
        lambda s, p: -p.force * (1 + abs(s.force) / 0.3) * s.z,
        lambda s, p: {"z": dahl_rate(s, p)},
    ),
    "stribeck": (
        {"breakaway": 1.8, "speed": 0.5, "reach": 0.02},
        lambda s, p: -p.force * s.z,
        lambda s, p: {"z": lugre_rate(s, p)},
    ),
    **{
        f"stribeck_{side}": (
            {"breakaway": 1.8, "speed": 0.5, "reach": 0.02, "edge": 0.2, "width": 0.3},
            lambda s, p, sign=sign: -p.force * s.z * past(s, p, sign),
            lambda s, p: {"z": lugre_rate(s, p)},
        )
        for side, sign in SIDES.items()
    },
    "stribeck_after": (
        {"breakaway": 1.8, "speed": 0.5, "reach": 0.02, **EVENT},
        lambda s, p: -p.force * s.z * event(s, p),
        lambda s, p: {"z": lugre_rate(s, p)},
    ),
    "slack_friction": ({"slack": 0.2, "reach": 0.3}, gripping),
    "stuck": ({"level": 0.2}, lambda s, p: -p.share * (s.value - 0.2)),
    "swapped": ({}, lambda s, p: p.share * (s.all[s.partner] - s.value)),
    "temperature_sensitivity": ({"reference": 0.2}, lambda s, p: p.slope * (s.ambient - 0.2)),
    "thermal_lag": (
        {"tau": 0.3, "second": 0.2},
        lambda s, p: p.share * (s.x - s.value),
        lambda s, p: {"v": (s.value - s.v) / 0.3, "w": (s.v - s.w) / 0.06, "x": (s.w - s.x) / 0.0216},
    ),
    **dict.fromkeys(
        ("weighted_displacement_hysteresis", "weighted_drive_hysteresis"),
        (
            {"reach": 0.3, "reversible": 0.7, **PARTS},
            lambda s, p: -p.share * (heavy_narrow(s, p) - 0.7 * s.value),
        ),
    ),
    "worn_backlash": ({"wear": 0.4, "spread": 0.5}, lambda s, p: 0.999 * (s.w + s.start * p.gap / 2 - s.displacement)),
    "warm_up": ({"tau": 0.4}, lambda s, p: p.size * (1 - exp(-s.t / 0.4))),
    "drift_per_record": ({}, lambda s, p: p.share * (s.zero + s.drift * s.t)),
    "zero_per_record": ({}, lambda s, p: p.share * s.zero),
    "vibration_per_record": (
        {"frequency": 3.0, "phase": 0.9},
        lambda s, p: p.amplitude * sin(TWO_PI * 3 * s.t + 0.9 + s.theta),
    ),
    "vibration": ({"frequency": 3.0, "phase": 0.9}, lambda s, p: p.amplitude * sin(TWO_PI * 3 * s.t + 0.9)),
}
AMPLITUDES = {
    "heater_resistance": 0.01,
    "heater_resistance_of_second_order": 0.01,
    "heat_loss": 0.01,
    "expansion": 0.01,
}  # of a share, an angle, a gain: 0.3


def parameters(kind: str, amplitude: float | None = None) -> SimpleNamespace:
    size = AMPLITUDES.get(kind, 0.3) if amplitude is None else amplitude
    return SimpleNamespace(**LAWS[kind][0], **{Effect.library[kind].amplitude().name: size})
