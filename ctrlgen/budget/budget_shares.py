"""The shares of the contributors of an error budget as a table prints them: each group adds up to 100 %."""

from __future__ import annotations

from dataclasses import dataclass

from ctrlgen.budget.budget_record import BudgetRecord
from ctrlgen.reporting.numbers import shares_text

NONE = "-"  # in a group that nothing moves
# of the whole: what correlated numbers have in common is told from here on, half of the last digit that is printed
TOLD = 0.0005


@dataclass(frozen=True)
class PrintedShares:
    """Of one group: the `rows` that are shown, what all `more` have together, what correlated numbers have in `common` (empty where
    that is nothing: they are not shares of one of them alone), and the `total`."""

    rows: list[str]
    more: str
    common: str
    total: str


def printed_shares(record: BudgetRecord, rows: int | None = None) -> dict[str, PrintedShares]:
    """By group; the first `rows` contributors by themselves, all where it is left out."""
    found = {}
    for k, group in enumerate(record.groups):
        shares = [c.effects[k].share for c in record.contributors]
        if not any(shares):
            found[group.name] = PrintedShares([NONE] * len(shares), NONE, "", NONE)
            continue
        shown, more = shares[:rows], sum(shares[rows:]) if rows is not None else 0.0
        common = 1 - sum(shares)
        parts = [*shown, more, common] if abs(common) >= TOLD else [*shown, more + common]
        texts = shares_text(parts)
        told = texts[len(shown) + 1] if abs(common) >= TOLD else ""
        found[group.name] = PrintedShares(texts[: len(shown)], texts[len(shown)], told, "100.0 %")
    return found
