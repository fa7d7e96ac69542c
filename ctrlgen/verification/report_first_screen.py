"""What report.html of a scenario says before anything else."""

from __future__ import annotations

from collections.abc import Mapping

from ctrlgen.budget.budget_record import BudgetRecord
from ctrlgen.budget.budget_section import BudgetSection
from ctrlgen.core.counts import number_of
from ctrlgen.core.to_digits import to_digits
from ctrlgen.reporting.numbers import number
from ctrlgen.reporting.page_figure import FirstScreen, PageFigure
from ctrlgen.verification.summary import MarginRow, Summary

# which figure shows the answer: the first of these that there is
MAIN = ("path", "stage_force", "drives")


def report_first_screen(
    s: Summary, figures: Mapping[str, PageFigure], budget: BudgetSection | None, budget_record: BudgetRecord | None
) -> FirstScreen:
    """Whether the path is followed within all limits and the C follows the model, how far the device may be off, and what to do next."""
    left_out = (f"{sentence[0].upper()}{sentence[1:]}." for sentence in s.left_out)
    answer = (_held(s), *left_out, *_uncertain(budget, budget_record))
    figure = next((figures[name] for name in MAIN if name in figures), next(iter(figures.values()), None))
    return FirstScreen(
        answer, "ok" if s.passed else "bad", figure, _numbers(s, budget_record), _steps(s, budget, budget_record)
    )


def tightest(s: Summary) -> MarginRow | None:
    """The limit with the smallest share of its range left."""
    return next((m for m in s.margins if m.limit == s.tightest), None)


def _held(s: Summary) -> str:
    if not s.passed:
        wrong = [
            (sum(not row.passed for row in s.comparison), len(s.comparison), "comparisons of the C with the model")
        ]
        wrong += [(sum(not e.passed for e in s.expected), len(s.expected), "values that the scenario expects")]
        told = " and ".join(f"{k} of {n} {what}" for k, n, what in wrong if k)
        return f"Out of tolerance: {told}. See the rows marked OUT."
    held = f"the path is followed within {number_of(len(s.margins), 'limit')}" if s.margins else "the path is followed"
    if s.comparison:
        held += f", and the C agrees with the model in all {len(s.comparison)} comparisons"
    return f"Everything checked is within tolerance: {held}."


def _uncertain(budget: BudgetSection | None, record: BudgetRecord | None) -> list[str]:
    if record is not None:
        bands = ", ".join(f"± {to_digits(g.band95)} {g.unit} ({g.name})" for g in record.groups)
        most = f", most by `{record.contributors[0].name}`" if record.contributors else ""
        return [
            "The checks compare drives and C with the model. What is not known exactly of the device moves the pose all the same, "
            f"within {bands} (95 %){most}."
        ]
    if budget is not None:
        missing = budget.missing.removesuffix(".")
        return [
            "The checks compare drives and C with the model. How far the device itself may be off is not known here: its error "
            f"budget is {missing}."
        ]
    return []


def _numbers(s: Summary, record: BudgetRecord | None) -> tuple[tuple[str, str], ...]:
    told: list[tuple[str, str]] = []
    if (m := tightest(s)) is not None and m.share_left is not None:
        told.append((f"tightest limit, {m.label}", f"{to_digits(100 * m.share_left, 3)} % left"))
        told.append((f"{m.channel} there, bound {to_digits(m.bound)} {m.unit}", f"{to_digits(m.value)} {m.unit}"))
    worst = max(s.tracking_error.items(), key=lambda item: abs(item[1]), default=None)
    if worst is not None and s.sample_rate_Hz:
        channel, unit = worst[0].removesuffix("]").split(" [")
        told.append((f"largest distance from the path, {channel}", f"{number(worst[1], 3)} {unit}"))
    for g in record.groups if record is not None else ():
        told.append((f"what is uncertain, {g.name}, 95 %", f"± {to_digits(g.band95)} {g.unit}"))
    if s.comparison:
        told.append(("C against model", f"{sum(r.passed for r in s.comparison)} of {len(s.comparison)}"))
    if s.c is not None:
        told.append(("operations of the C a sample", f"{s.c.operations_per_sample}"))
    return tuple(told)


def _steps(s: Summary, budget: BudgetSection | None, record: BudgetRecord | None) -> tuple[str, ...]:
    steps = []
    if not s.passed:
        steps.append("Find the first row marked OUT below: it names the build, the signal and the sample.")
    if budget is not None and not all(kept for _, kept in budget.sentences):
        steps.append(
            "Not every limit holds for what is uncertain: state `[robust]` with a probability in the scenario, and solve again."
        )
    if record is not None and record.contributors:
        first = record.contributors[0]
        most = max(first.effects, key=lambda effect: effect.share)
        steps.append(
            f"Measure or tighten `{first.name}` first: it makes up {to_digits(100 * most.share, 3)} % of the variance in {most.group} "
            "(`ctrlgen budget`)."
        )
    elif budget is None:
        steps.append(
            "State how well the numbers of the device are known (`sd`), and `ctrlgen budget` tells what that does."
        )
    if s.passed and s.c is not None:
        steps.append(
            "Put `c/` into the firmware project: `c/README.md` says how. `ctrlgen verify` counts what it costs there."
        )
    elif s.passed:
        steps.append("Generate the C with `ctrlgen run`.")
    steps.append("Run it on the stage, record that, and hold the model to it with `ctrlgen diagnose`.")
    return tuple(steps)
