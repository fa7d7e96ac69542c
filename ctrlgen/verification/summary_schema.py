"""What summary.json and build.json hold, key by key."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from ctrlgen.reporting.result_file import Keys, Number, Origin


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


class PlayerCandidate(Keys):
    """One way in which the player's drives could be stored."""

    kind: str = Field(description="Form: table, spline or Fourier series.")
    size: str = Field(description="Its size in words.")
    bytes: int | None = Field(description="Bytes of constant data.")
    operations: int | None = Field(description="Operations of one call.")
    instructions: int | None = Field(description="Instructions of one call, estimated.")
    length: Number = Field(description="Largest position error that it causes [m].")
    angle: Number = Field(description="Largest rotation error that it causes [rad].")
    drive: Number = Field(description="Largest drive error, as a share of the drive's range.")
    chosen: bool = Field(description="Whether it was generated.")
    remark: str = Field(description="Why not, where it was not.")


class GeneratedC(Keys):
    """Size of the generated C."""

    operations_per_sample: int = Field(description="Operations of one sample where no limit is active.")
    operations_worst: int = Field(description="Most operations that one sample can take.")
    player: dict[str, list[PlayerCandidate]] = Field(description="Candidates for the player, by arithmetic.")


class ComparisonEntry(Keys):
    """Generated C against the model, one build and one signal."""

    build: str = Field(description="Compiler, arithmetic and flags.")
    what: str = Field(description="What was compared.")
    signal: str = Field(description="The compared signal.")
    unit: str = Field(description="Unit of worst, rms and limit.")
    worst: Number = Field(description="Largest deviation.")
    rms: Number = Field(description="Root mean square deviation.")
    limit: float = Field(description="Largest deviation that passes.")
    samples: int = Field(description="Samples compared.")
    first: int | None = Field(description="First sample out of tolerance; null where there is none.")
    passed: bool = Field(description="Whether the largest deviation is within the limit.")


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
    limits_added: list[str] = Field(description="Composite limits that were added because a first solution broke them.")
    tracking_error: dict[str, float] = Field(description="Largest distance from the command, by 'channel [unit]'.")
    error_between_samples: dict[str, float] | None = Field(
        description="The same between samples, under held drives; null for a device without inertia."
    )
    robust: RobustPath | None = Field(description="Null where the limits hold for the device as described.")
    margins: list[MarginRow] = Field(description="One row a limit.")
    tightest: str = Field(description="Name of the limit with the smallest share left.")
    expected: list[ExpectedRow] = Field(description="One row an expectation of the scenario.")
    c: GeneratedC | None = Field(description="The generated C; null where none was asked for.")
    compilers: dict[str, str] = Field(description="Version of every compiler that ran, by name.")
    compilers_not_run: list[str] = Field(description="Compilers that are not installed.")
    comparison: list[ComparisonEntry] = Field(description="Generated C against the model.")


class NotRun(Keys):
    """A check that did not run."""

    what: str = Field(description="The check.")
    remedy: str = Field(description="How to make it run.")


class SignalChannels(Keys):
    """A signal of the C interface."""

    label: str = Field(description="The signal in words.")
    channels: list[str] = Field(description="'name [SI unit]', in the order of the C arrays.")


class StatusEntry(Keys):
    """One value of the controller's status."""

    value: int = Field(description="Its value in C, a bit of the status.")
    name: str = Field(description="Its name in C.")
    meaning: str = Field(description="What it tells the caller.")


class LimitEntry(Keys):
    """A limit that the controller keeps."""

    label: str = Field(description="The limited quantity in words.")
    lower: str | None = Field(description="Bound with its unit; null without one.")
    upper: str | None = Field(description="Bound with its unit; null without one.")


class Interface(Keys):
    """What the generated C takes and gives, in SI units."""

    functions: dict[str, list[str]] = Field(description="Signatures, by arithmetic.")
    target: SignalChannels = Field(description="What the controller is given at each sample.")
    drive: SignalChannels = Field(description="What it returns.")
    actuator_state: SignalChannels | None = Field(
        description="The actuators' states that it keeps account of; null for a device without any."
    )
    memory: list[str] = Field(description="'name [unit]' of what the controller keeps between samples.")
    status: list[StatusEntry] = Field(description="Values of the status.")
    limits: list[LimitEntry] = Field(description="Limits that the controller keeps.")


class Budgets(Keys):
    """Instructions of one sample that are aimed at."""

    core: str = Field(description="Processor for which they are stated.")
    scenario: int = Field(description="Along the scenario.")
    worst: int = Field(description="Over random and hostile targets.")
    player: int = Field(description="One call of the player.")


class CallCost(Keys):
    """Instructions of one kind of call on an emulated processor."""

    what: str = Field(description="The kind of call.")
    calls: int = Field(description="Calls counted.")
    mean: float = Field(description="Mean number of instructions.")
    worst: int = Field(description="Largest number of instructions.")
    worst_within: int | None = Field(description="The same where no limit is active.")


class Target(Keys):
    """The C on one emulated processor, compared with this computer bit by bit."""

    core: str = Field(description="The emulated processor.")
    compiler: str = Field(description="Compiler and flags.")
    real: str = Field(description="Arithmetic: float or double.")
    costs: list[CallCost] = Field(description="Instructions by kind of call.")
    stack: int = Field(description="Bytes of stack.")
    code: int = Field(description="Bytes of code.")
    tables: int = Field(description="Bytes of constant data.")
    writable: int = Field(description="Bytes of static writable memory; 0 is required.")
    numbers: int = Field(description="Numbers compared.")
    differing: int = Field(description="Numbers that differ.")
    ulp: int = Field(description="Largest difference in units in the last place.")
    where: str = Field(description="First call whose numbers differ; empty without one.")
    passed: bool = Field(description="Whether no number differs and no static memory is writable.")
    instructions: dict[str, int | None] = Field(description="Largest number of instructions of one call, by kind.")


class StoppedTarget(Keys):
    """An emulated run that stopped early."""

    core: str = Field(description="The emulated processor.")
    compiler: str = Field(description="Compiler and flags.")
    real: str = Field(description="Arithmetic: float or double.")
    words: str = Field(description="Why it stopped.")


class ToolFinding(Keys):
    """One finding of an analyser."""

    file: str = Field(description="The generated file.")
    line: int = Field(description="Its line.")
    rule: str = Field(description="The analyser's name of the rule.")
    severity: str = Field(description="The analyser's word for how grave it is.")
    text: str = Field(description="The analyser's message.")
    permitted: bool = Field(description="Whether DEVIATIONS.md permits it.")


class ToolCheck(Keys):
    """One tool that read or ran the generated C."""

    tool: str = Field(description="Name of the tool.")
    version: str = Field(description="Its version; empty where it is not known.")
    state: Literal["passed", "failed", "not run"] = Field(description="Its outcome.")
    note: str = Field(description="Remark, or the remedy where it did not run.")
    files: list[str] = Field(description="Files that it was given.")
    permitted: int = Field(description="Findings that DEVIATIONS.md permits.")
    findings: list[ToolFinding] = Field(description="Findings that it does not permit.")


class BuildRecord(Summary):
    """Result of `ctrlgen verify`: everything of summary.json, and every check of the generated C."""

    failures: list[str] = Field(description="What failed, one line each.")
    not_run: list[NotRun] = Field(description="Checks that did not run.")
    interface: Interface = Field(description="What the generated C takes and gives.")
    budgets: Budgets | None = Field(description="Null for devices for which no budget is stated.")
    errors_along_the_trajectory: list[dict[str, str | float]] = Field(
        description="Largest error of the model driven by the C, by 'channel [unit]', with the keys c (online C or player C) and real."
    )
    targets: list[Target] = Field(description="The C on emulated processors.")
    stopped: list[StoppedTarget] = Field(description="Emulated runs that stopped early.")
    checks: list[ToolCheck] = Field(description="Analysers and tests of the generated C.")
