"""The controller in integers of the generated C against the same integers computed in Python, and the model driven by it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ctrlgen.controller.fixed_point import FixedPoint, fixed_point
from ctrlgen.controller.fixed_step import FixedController, FixedState
from ctrlgen.verification.compared_program import ComparedProgram
from ctrlgen.verification.comparison_entry import ComparisonEntry, ComparisonKind, entry_of
from ctrlgen.verification.online_comparison import excess
from ctrlgen.verification.reference import ReferenceAnswers
from ctrlgen.verification.tracking import reached

SETTLED = 250  # of the random targets: each is exact or wrong, and Python takes a millisecond a call


@dataclass(frozen=True)
class IntegerAnswers:
    """What the C in integers must answer to the targets of the reference answers `ref`: (n, 1 + width) integers, the status first."""

    ref: ReferenceAnswers

    @cached_property
    def fixed(self) -> FixedPoint:
        """The maps of the C."""
        return fixed_point(self.ref.controller)

    @cached_property
    def controller(self) -> FixedController:
        """What answers."""
        return FixedController(self.fixed)

    @cached_property
    def start(self) -> FixedState:
        """At the sample before the first of the command."""
        return self.controller.at(self.controller.counts(self.ref.path[0]))

    @cached_property
    def command(self) -> np.ndarray:
        """(n, m) targets of the scenario."""
        return self.controller.counts(self.ref.command)

    @cached_property
    def random(self) -> np.ndarray:
        """(n, m) of the random targets."""
        return self.controller.counts(self.ref.random[:: max(1, len(self.ref.random) // SETTLED)])

    @cached_property
    def hostile(self) -> np.ndarray:
        """(n, m) of the hostile sequence; integers are all numbers, and what is none there is home here."""
        return self.controller.counts(self.ref.hostile)

    @cached_property
    def followed(self) -> np.ndarray:
        """Steps along the command."""
        return self._answers(self.command, self.start, settle=False)

    @cached_property
    def settled(self) -> np.ndarray:
        """At each random target, from rest on."""
        return self._answers(self.random, self.controller.rest(), settle=True)

    @cached_property
    def chased(self) -> np.ndarray:
        """Steps along the hostile sequence, from rest."""
        return self._answers(self.hostile, self.controller.rest(), settle=False)

    def in_si(self, answers: np.ndarray) -> np.ndarray:
        """The numbers of answers as those of the controller in real numbers."""
        bits = self.fixed.bits
        return answers * 2.0 ** -np.concatenate([[0], bits.drive, bits.displacement, bits.state])

    def _answers(self, targets: np.ndarray, state: FixedState, settle: bool) -> np.ndarray:
        rows = []
        for target in targets:
            step = self.controller.step(state, target, settle)
            state = step.after
            rows.append([int(step.status), *step.numbers])
        return np.array(rows)


def numbers_of(state: FixedState) -> tuple[np.ndarray, np.ndarray]:
    """What a program is started with: states and displacement."""
    return np.array(state.x), np.array(state.z)


def integer_rows(program: ComparedProgram, integers: IntegerAnswers) -> list[ComparisonEntry]:
    """All comparisons of the controller in integers of one build."""
    ref, rest = program.reference, integers.controller.rest()
    followed = program.run("follow", integers.command, ref.width, numbers_of(integers.start))
    settled = program.run("settle", integers.random, ref.width)
    chased = program.run("follow", integers.hostile, ref.width, numbers_of(rest))
    rows = [
        *_exact(program, ComparisonKind.FOLLOWED_INTEGERS, followed, integers.followed),
        *_exact(program, ComparisonKind.SETTLED_INTEGERS, settled, integers.settled),
        *_exact(program, ComparisonKind.CHASED_INTEGERS, chased, integers.chased),
        program.shipped_test(),
    ]
    drives = integers.in_si(chased)[:, ref.columns["drive"]]
    beyond = ref.once(
        "excess", drives, lambda drives: excess(ref.model, drives, ref.sample_time, ref.controller.rest()[0])
    )
    rows.append(entry_of(program.build, ComparisonKind.EXCESS, "share of its bound", "1", beyond, _proved(integers)))
    off = ref.once("reached", integers.in_si(followed), lambda answers: reached(ref, answers)) - ref.path
    # The device is off in the displacement by what is proved, and the target by half a count
    in_target = np.abs(np.linalg.inv(np.asarray(ref.controller.kernels.target_directions)))
    most = in_target @ (integers.fixed.off.stage + integers.fixed.off.target)
    for _, span in program.followed_channels():
        limit = float(most[span].max())
        rows.append(program.row(ComparisonKind.ONLINE_PATH, ref.scenario.file.follow, off, limit, span))
    return rows


def _exact(
    program: ComparedProgram, what: ComparisonKind, answer: np.ndarray, expected: np.ndarray
) -> list[ComparisonEntry]:
    """Status, drives, displacements and states, in counts: not one may differ."""
    columns = {"status": slice(0, 1), **program.reference.columns}
    return [
        entry_of(program.build, what, f"{role} in counts" if role != "status" else role, "1", difference, 0.0)
        for role, difference in ((role, (answer - expected)[:, span]) for role, span in columns.items())
    ]


def _proved(integers: IntegerAnswers) -> float:
    """By what share of a bound the device can be beyond it: the displacement by what the stage is off, the state by its own rounding."""
    m, off = integers.ref.model, integers.fixed.off
    shares = [off.stage / np.maximum(*np.abs(m.z_bounds))]
    states = np.maximum(*np.abs([bound[: m.n_states] for bound in m.x_bounds]))
    shares.append(off.state[np.isfinite(states)] / states[np.isfinite(states)])
    return float(max(np.max(share, initial=0.0) for share in shares))
