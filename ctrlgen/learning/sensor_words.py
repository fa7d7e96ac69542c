"""What a reader of learning from runs is told of the sensor."""

from __future__ import annotations

from ctrlgen.budget.contributors import Group
from ctrlgen.core.to_digits import to_digits
from ctrlgen.learning.learn import Learning
from ctrlgen.learning.sensor_budget import ASSUMED

NAMED = 0.3
"""Of the budget, from which on one of its lines is named."""
TOLD = 0.01
"""Of the error, from which on what is left to the sensor is told: less is rounding of the rule."""


def left_to_sensor(learning: Learning, group: Group) -> float:
    """[SI] root mean square of what was read and is left to the sensor; zero where that is rounding."""
    left = learning.of_group(learning.left_to_sensor, group)
    return left if left > TOLD * learning.runs[0].rms[group.name] else 0.0


def sensor_words(learning: Learning) -> list[str]:
    """The budget of the sensor by group, what was left to it, and how to tell sensor and stage apart."""
    words, told, assumed = list[str](), False, False
    for g in learning.groups:
        may = learning.of_group(learning.sensor.may_feign(), g)
        if not may:
            continue
        sizes = [
            (learning.sensor.coverage * learning.of_group(line.deviation, g), line) for line in learning.sensor.lines
        ]
        large = sorted((pair for pair in sizes if pair[0] >= NAMED * may), key=lambda pair: -pair[0])
        by = ", ".join(f"{line.name} {line.sd}" for _, line in large)
        assumed |= any(line.source == ASSUMED for _, line in large)
        text = f"budget of the sensor: up to {to_digits(g.shown(may), 3)} {g.unit} of {g.name} may be its error ({by})"
        left = left_to_sensor(learning, g)
        if left:
            told = True
            text += f"; {to_digits(g.shown(left), 3)} {g.unit} that were read are left to it, and the motion is not called better for them"
        words.append(f"{text}.")
    if assumed:
        words.append(
            "Its standard deviations are assumed: learning stops at about this size. Where the sensor is known better, state it as "
            "[sensor] in uncertainty.toml, and learning goes on."
        )
    if told:
        words.append(
            "A second sensor, or a run with the specimen turned by 90 degrees under the sensor, tells its error from the stage's."
        )
    return words
