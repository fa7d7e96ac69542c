"""What a batch says of all its results: results.csv, batch.json while it runs and after, and the same for data frames as Parquet.

results.parquet has the rows of results.csv and their state. numbers.parquet has a row for every number of every diagnosis, `name` (of the
result), `quantity`, `value`, `low` and `high` (95 %, missing for errors), `unit`: held-out errors before and after, noise, and the
parameters of the causes. Both are written from one diagnosis.json after another, so that their length takes no memory.
"""

from __future__ import annotations

import csv
import io
import json
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from ctrlgen.app.batch_row import BatchRow
from ctrlgen.core.escaping import csv_cell
from ctrlgen.core.files import whole_file, write_text

TABLE = "results.csv"
PROGRESS = "batch.json"
TABLES = ("results.parquet", "numbers.parquet")
SECONDS = 2.0  # between two writings of the table: of a thousand recordings it has 100 kB
ROWS_AT_ONCE = 5000  # of a Parquet file that are in memory


class BatchTables:
    """Keeps results.csv and batch.json of the folder `out` up to date, no more than every `SECONDS`. Raises InputError as files are
    written."""

    def __init__(self, names: Sequence[str], out: Path) -> None:
        self.names, self.out, self.written = names, out, -float("inf")

    def told(self, rows: dict[str, BatchRow]) -> None:
        """After each result: writes both where the last time is long enough ago."""
        if time.monotonic() - self.written > SECONDS:
            self.write(rows)

    def write(self, rows: dict[str, BatchRow]) -> None:
        """Writes both now."""
        there = [rows[name] for name in self.names if name in rows]
        write_text(self.out / TABLE, _csv(there))
        write_text(self.out / PROGRESS, json.dumps(progress_record(there, len(self.names)), indent=1) + "\n")
        self.written = time.monotonic()


def progress_record(rows: Sequence[BatchRow], total: int) -> dict[str, Any]:
    """What batch.json holds: how many diagnoses there are, are done, and failed; how many of each verdict."""
    failed = sum(row.state == "failed" for row in rows)
    verdicts = Counter(row.verdict for row in rows if row.verdict)
    return {"total": total, "done": len(rows), "failed": failed, "verdicts": dict(verdicts.most_common())}


def _csv(rows: Iterable[BatchRow]) -> str:
    text = io.StringIO()
    table = csv.DictWriter(
        text, [f.name for f in fields(BatchRow) if f.name != "state"], lineterminator="\n", extrasaction="ignore"
    )
    table.writeheader()
    for row in rows:
        table.writerow({key: csv_cell(v) if isinstance(v, str) else v for key, v in asdict(row).items()})
    return text.getvalue()


def write_parquet(rows: Sequence[BatchRow], out: Path) -> bool:
    """Writes `TABLES` of a batch whose result folders are in `out`; False where pyarrow is not installed. Raises InputError."""
    try:
        import pyarrow as pa
    except ModuleNotFoundError:
        return False
    text, number = pa.string(), pa.float64()
    named = ("before", "after", "noise")
    columns = [(f.name, number if f.name in named else text) for f in fields(BatchRow)]
    _write(out / TABLES[0], pa.schema(columns), (asdict(row) for row in rows))
    numbers = [
        (k, text if k in ("name", "quantity", "unit") else number)
        for k in ("name", "quantity", "value", "low", "high", "unit")
    ]
    _write(out / TABLES[1], pa.schema(numbers), (entry for row in rows for entry in _numbers(row.name, out / row.name)))
    return True


def _write(path: Path, schema: Any, entries: Iterator[dict[str, Any]]) -> None:
    """A Parquet file of these entries, whole or not at all."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with whole_file(path) as draft, pq.ParquetWriter(draft, schema, compression="zstd") as file:
        for part in _parts(entries):
            file.write_table(pa.Table.from_pylist(part, schema))


def _parts(entries: Iterator[dict[str, Any]]) -> Iterator[list[dict[str, Any]]]:
    part: list[dict[str, Any]] = []
    for entry in entries:
        part.append(entry)
        if len(part) == ROWS_AT_ONCE:
            yield part
            part = []
    if part:
        yield part


def _numbers(name: str, folder: Path) -> Iterator[dict[str, Any]]:
    """The numbers of one diagnosis; none where it is not there or not readable."""
    try:
        record = json.loads((folder / "diagnosis.json").read_text(encoding="utf-8"))
        held_out, findings = record["held_out"], record["findings"]
        for channel, e in held_out.items():
            for key, what in (("rms_before", "error before"), ("rms_after", "error after"), ("noise_floor", "noise")):
                if e[key] is not None:
                    yield {"name": name, "quantity": f"{what}: {channel}", "value": float(e[key]), "unit": e["unit"]}
        for finding in findings:
            for parameter, e in finding["parameters"].items():
                low, high = e["ci95"]
                quantity = f"{finding['effect']} at {finding['location']}: {parameter}"
                yield {
                    "name": name,
                    "quantity": quantity,
                    "value": e["value"],
                    "low": low,
                    "high": high,
                    "unit": e["unit"],
                }
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return
