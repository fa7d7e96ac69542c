"""What summary.json holds of a solution and of its generated C, key by key."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from pydantic import Field

from ctrlgen.core.units import difference, from_si, show, shown_difference_unit
from ctrlgen.devices import Signal
from ctrlgen.firmware.folder import CFolder
from ctrlgen.firmware.player.compression import PlayerCandidate
from ctrlgen.reporting.result_file import Keys, Number, Origin, origin
from ctrlgen.trajectory.metrics import ExpectationResult, in_unit
from ctrlgen.trajectory.solution import Margin, Solution
from ctrlgen.verification.comparison import Comparison
from ctrlgen.verification.comparison_entry import ComparisonEntry


class MarginRow(Keys):
    """How near one limit of the device was approached."""

    limit: str = Field(description="Name of the limit.")
    label: str = Field(description="The limited quantity in words.")
    unit: str = Field(description="Unit of value and bound.")
    channel: str = Field(description="Channel that came nearest.")
    sample: int = Field(description="Sample at which it did.")
    time_s: Number = Field(description="Time of that sample [s]; null for settled poses.")
    value: float = Field(description="The quantity there.")
    bound: float = Field(description="The bound of the device that it approached.")
    reserve: float = Field(
        description="What is kept of it for what is not known exactly, in margin_unit; 0 where nothing is."
    )
    margin: float = Field(description="Distance between both less the reserve, in margin_unit.")
    margin_unit: str = Field(description="Unit of margin; K for a temperature.")
    share_left: Number = Field(description="Margin as a share of the limit's range; null for a limit without a range.")


class RobustPath(Keys):
    """Limits that hold for what is not known exactly."""

    probability: float = Field(description="With which all limits hold along the path.")
    moved: dict[str, float] = Field(
        description="By how much the path was moved for the least expected error, by 'channel [unit]'."
    )
    sentence: str = Field(description="The same in words.")


class ExpectedRow(Keys):
    """One expectation of the scenario file."""

    value: str = Field(description="Name of the metric.")
    unit: str = Field(description="Unit of measured, low and high.")
    measured: float = Field(description="What the solution gives.")
    low: Number = Field(description="Smallest value that passes; null without one.")
    high: Number = Field(description="Largest value that passes; null without one.")
    passed: bool = Field(description="Whether it is between both.")
    source: str = Field(description="Where the expected value comes from.")


class GeneratedC(Keys):
    """Size of the generated C."""

    operations_per_sample: int = Field(description="Operations of one sample where no limit is active.")
    operations_worst: int = Field(description="Most operations that one sample can take.")
    player: dict[str, tuple[PlayerCandidate, ...]] = Field(description="Candidates for the player, by arithmetic.")


class Summary(Origin):
    """Result of `ctrlgen run` and `ctrlgen solve`: the solved trajectory, its margins, and the generated C against the model."""

    scenario: str = Field(description="Name of the scenario.")
    title: str = Field(description="Title of the scenario file.")
    device: str = Field(description="Name of the device.")
    passed: bool = Field(description="Whether everything that was checked is within tolerance.")
    samples: int = Field(description="Samples of the trajectory.")
    sample_rate_Hz: Number = Field(description="Samples a second [Hz]; null for settled poses.")
    closed: bool = Field(description="Whether the trajectory ends where it begins.")
    ipopt_iterations: int = Field(description="Iterations of IPOPT; of Newton's method for a device with inertia.")
    solved_by: str = Field(description="The method, with its iterations or by how much its equations are off.")
    limits_added: list[str] = Field(description="Composite limits that were added because a first solution broke them.")
    tracking_error: dict[str, float] = Field(description="Largest distance from the command, by 'channel [unit]'.")
    error_between_samples: dict[str, float] | None = Field(
        description="The same between samples, under held drives; null for a device without inertia."
    )
    left_out: tuple[str, ...] = Field(
        description="What the device file states and the model leaves out, where the path notices: masses without [dynamics], stretching."
    )
    robust: RobustPath | None = Field(description="Null where the limits hold for the device as described.")
    margins: list[MarginRow] = Field(description="One row a limit.")
    tightest: str = Field(description="Name of the limit with the smallest share left.")
    expected: list[ExpectedRow] = Field(description="One row an expectation of the scenario.")
    c: GeneratedC | None = Field(description="The generated C; null where none was asked for.")
    compilers: dict[str, str] = Field(description="Version of every compiler that ran, by name.")
    compilers_not_run: tuple[str, ...] = Field(description="Compilers that are not installed.")
    comparison: tuple[ComparisonEntry, ...] = Field(description="Generated C against the model.")


def summary(
    solution: Solution, comparison: Comparison | None, expected: tuple[ExpectationResult, ...], c: CFolder | None
) -> Summary:
    """Plain numbers in the stated units; nothing that changes from run to run."""
    return Summary(**summary_keys(solution, comparison, expected, c))


def summary_keys(
    solution: Solution, comparison: Comparison | None, expected: tuple[ExpectationResult, ...], c: CFolder | None
) -> dict[str, Any]:
    """The keys of `Summary`."""
    scenario = solution.scenario
    error = np.abs(solution.trace.signals[scenario.file.follow] - solution.command).max(axis=0)
    signal = solution.model.signals[scenario.file.follow]
    return origin(scenario.digest) | {
        "scenario": scenario.name,
        "title": scenario.file.title,
        "device": solution.model.name,
        "passed": passed(comparison, expected),
        "samples": len(solution.command),
        "sample_rate_Hz": 1 / scenario.sample_time if scenario.sample_time else None,
        "closed": scenario.closed,
        "ipopt_iterations": solution.iterations,
        "solved_by": solution.solved_by,
        "limits_added": list(solution.rows_added),
        "tracking_error": by_channel(signal, error),
        "error_between_samples": None if (between := solution.between_samples) is None else by_channel(signal, between),
        "left_out": solution.left_out,
        "robust": _robust(solution),
        "margins": [_margin(m, solution) for m in solution.margins],
        "tightest": solution.tightest.limit.name,
        "expected": [_expected(e) for e in expected],
        "c": None if c is None else _generated(c),
        "compilers": comparison.compilers if comparison else {},
        "compilers_not_run": comparison.missing if comparison else (),
        "comparison": comparison.rows if comparison else (),
    }


def by_channel(signal: Signal, values: Iterable[float]) -> dict[str, float]:
    """'channel [unit]' -> value in that unit."""
    channels = zip(signal.channels, signal.units, values, strict=True)
    return {f"{channel} [{unit}]": float(from_si(value, unit)) for channel, unit, value in channels}


def passed(comparison: Comparison | None, expected: tuple[ExpectationResult, ...]) -> bool:
    """Whether every expectation and every comparison that was made is within tolerance."""
    return (comparison is None or comparison.passed) and all(e.passed for e in expected)


def _robust(solution: Solution) -> RobustPath | None:
    """With which probability the limits hold, and to where the path was moved for that; None for the device as described."""
    if solution.model.probability is None:
        return None
    signal = solution.model.signals[solution.scenario.file.follow]
    units, home = dict(zip(signal.channels, signal.units, strict=True)), solution.scenario.home
    moved = {f"{channel} [{units[channel]}]": float(difference(by, units[channel])) for channel, by in home.items()}
    return RobustPath(probability=solution.model.probability, moved=moved, sentence=robust_sentence(solution))


def robust_sentence(solution: Solution) -> str:
    """Such as 'all limits hold with 99.9 % for what is not known exactly; moved by delta_z = -8.41 um'; empty where nothing is reserved."""
    if solution.model.probability is None:
        return ""
    signal = solution.model.signals[solution.scenario.file.follow]
    units = dict(zip(signal.channels, signal.units, strict=True))
    moved = ", ".join(f"{c} = {'+' if v > 0 else ''}{show(v, units[c])}" for c, v in solution.scenario.home.items())
    sentence = (
        f"all limits hold with {100 * solution.model.probability:.10g} % along the path for what is not known exactly"
    )
    return sentence + (f"; for the least error it is moved by {moved}" if moved else "")


def _margin(m: Margin, solution: Solution) -> MarginRow:
    unit = m.limit.unit
    return MarginRow(
        limit=m.limit.name,
        label=m.limit.label,
        unit=unit,
        channel=m.channel,
        sample=m.sample,
        time_s=float(solution.trace.time[m.sample]) if solution.scenario.sample_time else None,
        value=float(from_si(m.value, unit)),
        bound=float(from_si(m.limit.described(m.bound), unit)),
        reserve=float(difference(m.reserve, unit)),
        margin=float(difference(m.distance, unit)),
        margin_unit=shown_difference_unit(unit),
        share_left=m.share,
    )


def _expected(e: ExpectationResult) -> ExpectedRow:
    measured, low, high = (in_unit(v, e.unit) for v in (e.measured, e.low, e.high))
    return ExpectedRow(
        value=e.value, unit=e.unit, measured=measured, low=low, high=high, passed=e.passed, source=e.source
    )


def _generated(c: CFolder) -> GeneratedC:
    player = {real.value: held.candidates for real, held in c.compression.items()}
    return GeneratedC(operations_per_sample=c.operations, operations_worst=c.worst_operations, player=player)
