"""What a law may require of a device: the words of `Effect.requires`, and how messages say them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

REQUIREMENTS: Mapping[str, str] = MappingProxyType(
    {
        "acceleration": "an imposed motion",
        "actuator": "an actuator, and not an imposed motion",
        "ambient": "the temperature of the surroundings",
        "balanced": "a stage in balance, without inertia",
        "bipolar": "a drive of both signs",
        "delivered": "a drive that no feedback of the readings decides on, and no imposed motion",
        "displacement_command": "an actuator that is told how far to go",
        "force": "forces in N or N*m",
        "heat": "heaters",
        "sample_time": "a sample time",
        "second_order_kinematics": "the second-order kinematics of the links, and a pose that is without it",
        "spatial": "a pose of six components",
        "spring": "a stage that pulls home",
        "state": "heaters, whose temperature it reads",
        "tangent_compliance": "the tangent compliance of the stages",
        "unheated": "actuators without heaters",
        "velocity": "axes with inertia or an imposed motion",
        "voltage": "a drive in volt",
    }
)
