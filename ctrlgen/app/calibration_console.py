"""Console output of a calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape

from ctrlgen.app.console import out, show_table, table_of
from ctrlgen.core.to_digits import to_digits
from ctrlgen.core.units import difference

if TYPE_CHECKING:
    from ctrlgen.budget.error_budget import ErrorBudget
    from ctrlgen.calibration.calibrate import Calibration
    from ctrlgen.calibration.measured_jacobian import MeasuredJacobian


def print_calibration(calibration: Calibration, budgets: tuple[ErrorBudget, ErrorBudget] | None) -> None:
    """The constants, the error on held-out records, and the budgets where there are some."""
    out.print(f"[bold]calibration: {escape(calibration.recording.title)}[/bold]", soft_wrap=True)
    table = table_of(
        ("constant", "left"), ("device file", "right"), ("specimen", "right"), ("95 % interval", "right"), ("", "left")
    )
    for row in calibration.constants:
        c = row.constant
        value, *ends = row.texts
        interval = " ... ".join(ends) if row.determined else f"bounds {c.range_text}"
        remark = row.remark if row.determined else f"default kept: {row.remark}"
        table.add_row(escape(c.path), c.shown(c.default), value, interval, remark)
    show_table(table)
    table = table_of(
        ("held-out error, rms", "left"), ("device file", "right"), ("specimen", "right"), ("noise", "right")
    )
    for e in calibration.errors:
        cells = [f"{to_digits(difference(v, e.unit))} {e.unit}" for v in (e.before, e.after, e.noise)]
        table.add_row(escape(e.channel), *cells)
    show_table(table)
    if budgets is not None:
        from ctrlgen.calibration.budgets_compared import spoiled_by_sensor

        before, after = budgets
        spoiled = spoiled_by_sensor(calibration, after)
        title = before.solution.scenario.file.title
        for g in before.groups:
            both = f"{to_digits(g.shown(before.peak(g)))} -> {to_digits(g.shown(after.peak(g)))} {g.unit}"
            what = f"largest combined standard uncertainty, {g.name}"
            out.print(f"budget of {title}: {what}: {both}", markup=False, soft_wrap=True)
            if spoiled[g.name]:
                of_sensor = f"and {to_digits(g.shown(spoiled[g.name]), 3)} {g.unit} of true motion that the scale of the sensor may spoil"
                out.print(f"budget of {title}: {of_sensor} (one standard deviation)", markup=False, soft_wrap=True)
    for note in calibration.notes:
        out.print(note, markup=False, soft_wrap=True, style="yellow")


def print_jacobian(found: MeasuredJacobian) -> None:
    """How many numbers were fitted, the few where it is few, and the norms of the errors of the poses before and after."""
    from ctrlgen.calibration.jacobian_record import jacobian_record

    record = jacobian_record(found)
    told = f"{found.numbers} numbers fitted to {record.poses_fitted} poses, condition of the drives {to_digits(found.condition, 3)}"
    out.print(f"[bold]measured Jacobian: {escape(found.recording.title)}[/bold]", soft_wrap=True)
    out.print(told, markup=False, soft_wrap=True)
    if found.few:
        table = table_of(("fitted", "left"), ("value", "right"), ("sd", "right"))
        for n in found.few:
            unit = "" if n.unit == "1" else f" {n.unit}"
            table.add_row(escape(n.name), f"{n.value:.6g}{unit}", f"{to_digits(n.sd, 2)}{unit}")
        show_table(table)
    table = table_of(("error", "left"), ("mean, as described", "right"), ("mean", "right"), ("largest", "right"))
    for e in record.norms:
        cells = [f"{to_digits(v)} {e.unit}" for v in (e.mean_before, e.mean_after, e.max_after)]
        table.add_row(f"{e.part}, {e.poses}", *cells)
    show_table(table)
    if record.home:
        table = table_of(
            ("home", "left"), ("drift a pose", "right"), ("repeatability", "right"), ("95 % interval", "right")
        )
        for h in record.home:
            low, high = h.repeatability_interval
            drift = f"{to_digits(h.drift, 3)} {h.unit}{', taken out' if h.taken_out else ''}"
            table.add_row(
                h.channel,
                drift,
                f"{to_digits(h.repeatability, 3)} {h.unit}",
                f"{to_digits(low, 3)} ... {to_digits(high, 3)} {h.unit}",
            )
        show_table(table)
    for share in record.instruments:
        off = f"{to_digits(share.rotation_deg, 2)} deg, {to_digits(share.translation_um, 2)} um"
        feigned = f"{share.name}, one sd: poses off by {off} at most"
        out.print(feigned, markup=False, soft_wrap=True)
    for note in found.recording.notes:
        out.print(note, markup=False, soft_wrap=True, style="yellow")
