"""Why a path cannot be followed at a probability: which limits are short of what is uncertain, where and by how much."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ctrlgen.budget.chance_constraint import ChanceConstraint
from ctrlgen.budget.judged_path import JudgedPath
from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Infeasibility, Unreachable
from ctrlgen.core.units import show, show_difference
from ctrlgen.trajectory.infeasibility import instead
from ctrlgen.trajectory.inverse.clock import Clock
from ctrlgen.trajectory.solution import Solution

SHOWN = 6  # limits that an explanation lists


def not_kept(
    solution: Solution, judged: JudgedPath, chance: ChanceConstraint, probability: str, begin: str
) -> Unreachable:
    """The error that names the limits, by how much each is short at which sample, and the probability that the path has; its text has a
    `begin` of its own. Limits are to hold with the `probability`, as the scenario writes it."""
    reserve, possible = chance.reserve, chance.possible
    short = np.where(judged.margins.sd > 0, np.maximum(reserve - judged.margins.margin, 0.0), 0.0)
    rows = sorted(_missing(judged, reserve, short, solution.scenario.clock), key=lambda row: -row[0])
    samples = tuple(map(int, np.flatnonzero((short > 0).any(axis=(0, 2)))))
    could = f"{100 * possible:.3g} %" if possible > 0 else "no probability that is known"
    lines = [
        f"{begin}cannot keep all limits with {probability}, in {len(samples)} of {short.shape[1]} samples; they are kept with {could}",
        *(text for _, text, _ in rows[:SHOWN]),
    ]
    if len(rows) > SHOWN:
        lines.append(f"  and {number_of(len(rows) - SHOWN, 'more limit')}")
    tightened = solution.model.tightened(judged.largest(reserve), chance.probability)
    line, others = instead(solution.scenario.bind(tightened), [k for *_, k in rows])
    lines += [f"{line}, with the same reserves"] * bool(others)
    return Unreachable("\n".join(lines), Infeasibility(samples, rows[0][2], solution.command, None, others))


def _missing(
    judged: JudgedPath, reserve: np.ndarray, short: np.ndarray, clock: Clock
) -> Iterator[tuple[float, str, int]]:
    """For each bound that is not kept: what is missing in standard uncertainties, a line of text, the worst sample."""
    m = judged.margins
    for limit, columns in judged.path.places:
        for side, away in enumerate(("above", "below")):
            k, i = np.unravel_index(int(np.argmax(short[side, :, columns])), short[side, :, columns].shape)
            at = side, int(k), columns.start + int(i)
            if not short[at]:
                continue
            bound, margin = float(m.bounds[side, at[2]]), float(m.margin[at])
            value = show(bound + (margin if side == 0 else -margin), limit.unit)
            left, taken, lacking = (show_difference(v, limit.unit) for v in (margin, reserve[at], short[at]))
            text = (
                f"  {limit.label} at {limit.channels[i]}: {value} at sample {k}{clock.moment(at[1])} is {left} {away} "
                f"{show(bound, limit.unit)}, but what is uncertain takes {taken} there: short by {lacking}"
            )
            yield float(short[at] / m.sd[at]), text, at[1]
