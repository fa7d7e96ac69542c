"""Batch diagnosis: from a list of recordings, one result folder per diagnosis and a table of all.

    seed = 0                              # optional
    laws = ["creep", "stiffening"]        # optional: the effects to consider, by default all
    [[job]]
    device = "devices/stage.toml"         # paths as seen from this file
    recordings = ["runs/*", ["a", "b"]]   # a diagnosis for each match; the recordings of an inner list are joined
    name = "stage"                        # optional: what the result folders' names begin with, else the device file's name

A result folder appears whole when its diagnosis is done. A result made before from the same files by the same code is
kept: a batch that was stopped continues where it was.
"""

from __future__ import annotations

import json
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from ctrlgen.app.batch_page import batch_page
from ctrlgen.app.batch_row import BatchRow
from ctrlgen.app.batch_tables import BatchTables, write_parquet
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.file_format import refuse_another_kind
from ctrlgen.core.files import MARKER, read_toml, validate, whole_folder, write_text
from ctrlgen.core.parallel import Failure, run_all
from ctrlgen.devices.section import Section
from ctrlgen.diagnosis.diagnosis_folder import Replicates, diagnose_into, digests
from ctrlgen.effects import installed
from ctrlgen.estimation.hypothesis import selected_laws
from ctrlgen.version import code_hash

MADE_FROM = "made_from.json"  # in each result folder: what the result depends on
PAGE = "batch.html"
MOST_WILD = 4  # of * and ? in a pattern, and no **: more walk through whole disks

Progress = Callable[[int, int], None]


class JobTable(Section):
    """One [[job]] of the list."""

    device: str
    """The device file, relative to the list."""
    recordings: Annotated[tuple[str | tuple[str, ...], ...], Field(min_length=1)]
    """Recordings, relative to the list; `*` and `?` match several, one diagnosis each. An inner list is joined into one
    diagnosis.
    """
    name: str | None = Field(default=None, pattern=r"^[\w.-]+$")
    """What the names of the result folders begin with. Left out: the device file's name."""


class BatchFile(Section):
    """The schema of the list."""

    seed: int = 0
    """Seed of everything drawn at random; `--seed` replaces it."""
    laws: tuple[str, ...] | None = None
    """Kinds of the effects to consider. Left out: all."""
    job: Annotated[tuple[JobTable, ...], Field(min_length=1)]
    """`[[job]]` tables: what is diagnosed."""


@dataclass(frozen=True)
class Task:
    """One diagnosis: the `name` of its result folder, its files, and the other inputs of its result."""

    name: str
    device: str
    recordings: tuple[str, ...]
    seed: int
    replicates: int = 0
    laws: tuple[str, ...] | None = None

    def made_from(self) -> dict[str, Any]:
        """Everything the result depends on, files as their SHA-256. Raises InputError where a file cannot be read."""
        hashes = digests(Path(self.device), [Path(r) for r in self.recordings])
        laws = None if self.laws is None else list(self.laws)
        return {
            "code": code_hash() + installed().digest,
            "seed": self.seed,
            "replicates": self.replicates,
            "laws": laws,
            "files": hashes,
        }

    def __call__(self) -> dict[str, bytes]:
        """The content of the result folder by file name; it is made in a temporary folder."""
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "result"
            replicates = Replicates(self.replicates, jobs=0) if self.replicates else None
            diagnose_into(self.device, list(self.recordings), out, self.seed, replicates=replicates, laws=self.laws)
            paths = sorted(p for p in out.rglob("*") if p.is_file() and p.name != MARKER)
            return {str(p.relative_to(out)): p.read_bytes() for p in paths}


def load_batch(path: Path | str, seed: int | None = None, replicates: int = 0) -> tuple[Task, ...]:
    """The diagnoses that the list at `path` asks for. Raises InputError with every fault of the list."""
    path = Path(path)
    table = read_toml(path)
    refuse_another_kind(table, path, "jobs", "name a list of [[job]] tables (ctrlgen batch --help shows one)")
    written = validate(BatchFile, table, path)
    tasks, faults = [], []
    for k, job in enumerate(written.job):
        device = path.parent / job.device
        if not device.is_file():
            faults.append(Fault(f"job[{k}].device", f"{device} does not exist; check the path"))
        for group in _groups(job, path.parent):
            if isinstance(group, Fault):
                faults.append(Fault(f"job[{k}].recordings", group.what))
                continue
            name = f"{job.name or device.stem}--{'+'.join(_name(p) for p in group)}"
            paths = tuple(str(p.resolve()) for p in group)
            chosen = written.seed if seed is None else seed
            tasks.append(Task(name, str(device.resolve()), paths, chosen, replicates, written.laws))
    try:
        selected_laws(written.laws)
    except InputError as error:
        faults += [Fault("laws", f"{fault.where} {fault.what}") for fault in error.faults]
    names = [task.name for task in tasks]
    for name in sorted({n for n in names if names.count(n) > 1}):
        faults.append(
            Fault(
                "job",
                f"{names.count(name)} diagnoses would have the result folder {name}; give each job a name of its own",
            )
        )
    if faults:
        raise InputError(path, faults)
    return tuple(tasks)


def _groups(job: JobTable, folder: Path) -> Iterator[list[Path] | Fault]:
    """The recordings of each diagnosis; a fault for each text that matches nothing."""
    for given in job.recordings:
        matches = [_matches(folder, text) for text in ((given,) if isinstance(given, str) else given)]
        for text, paths in zip((given,) if isinstance(given, str) else given, matches, strict=True):
            if not paths:
                yield Fault(
                    "",
                    f"nothing matches {text!r}; name a folder with a recording.toml, or the file itself ({MOST_WILD} * or ? at most)",
                )
        if isinstance(given, str):
            yield from ([path] for path in matches[0])
        elif all(matches):
            yield [path for paths in matches for path in paths]


def _matches(folder: Path, text: str) -> list[Path]:
    """The folders and .toml files that `text` names; of the folders that match a pattern, those with a recording."""
    if len(re.findall(r"[*?\[]", text)) > MOST_WILD or "**" in text:
        return []
    try:
        if not re.search(r"[*?\[]", text):
            return [folder / text] if (folder / text).exists() else []
        paths = sorted(Path("/").glob(text[1:]) if text.startswith("/") else folder.glob(text))
    except (OSError, ValueError, RecursionError):  # a name too long, a pattern that is none
        return []
    return [p for p in paths if (p.is_dir() and (p / "recording.toml").is_file()) or p.suffix == ".toml"]


def _name(path: Path) -> str:
    return re.sub(r"[^\w.-]+", "_", path.resolve().stem if path.suffix == ".toml" else path.resolve().name)


def run_batch(
    tasks: Path | str | Sequence[Task],
    out: Path | str,
    scheduler: str | None = None,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> tuple[BatchRow, ...]:
    """Runs every diagnosis of `tasks`, which may be the list's file, into its folder in `out`; results.csv and batch.json follow, at the
    end Parquet files and batch.html.

    `ctrlgen.core.parallel` decides where they run; only this process writes. A diagnosis that fails gives a row that says
    why. Raises InputError where `out` cannot be written or the scheduler does not answer.
    """
    tasks = load_batch(tasks) if isinstance(tasks, Path | str) else tasks
    out, rows = Path(out), {}
    to_do: list[tuple[Task, dict[str, Any]]] = []
    for task in tasks:
        try:
            made_from = task.made_from()
        except (InputError, OSError) as error:
            rows[task.name] = BatchRow(task.name, "failed", error=_one_line(str(error)))
            continue
        if (row := earlier(task.name, out / task.name, made_from)) is not None:
            rows[task.name] = row
        else:
            to_do.append((task, made_from))
    before = len(tasks) - len(to_do)
    tables = BatchTables([task.name for task in tasks], out)
    tables.write(rows)

    def told(done: int, _: int) -> None:
        if progress is not None:
            progress(before + done, len(tasks))

    if progress is not None:
        progress(before, len(tasks))
    try:
        for k, result in run_all(work_on, [task for task, _ in to_do], scheduler, jobs, told):
            task, made_from = to_do[k]
            rows[task.name] = _kept(task, made_from, result, out)
            tables.told(rows)
    finally:
        for task, made_from in to_do:  # stopped between a result and its row: what is there counts
            if task.name not in rows and (row := earlier(task.name, out / task.name, made_from)) is not None:
                rows[task.name] = replace(row, state="done")
        tables.write(rows)
    in_order = tuple(rows[task.name] for task in tasks)
    write_parquet(in_order, out)
    write_text(out / PAGE, batch_page(in_order, out, out.resolve().name))
    return in_order


def work_on(task: Task) -> dict[str, bytes]:
    """What a worker does: the files of the result, by name."""
    return task()


def _kept(task: Task, made_from: dict[str, Any], result: dict[str, bytes] | Failure, out: Path) -> BatchRow:
    """Writes the result as a whole folder; its row."""
    if isinstance(result, Failure):
        return BatchRow(task.name, "failed", error=_one_line(result.what))
    try:
        with whole_folder(out / task.name) as draft:
            for name, content in result.items():
                (draft / name).parent.mkdir(parents=True, exist_ok=True)
                (draft / name).write_bytes(content)
            (draft / MADE_FROM).write_text(json.dumps(made_from, indent=1) + "\n", encoding="utf-8")
    except InputError as error:  # the folder holds files that are not ours
        return BatchRow(task.name, "failed", error=_one_line(str(error)))
    return _row(task.name, "done", result["diagnosis.json"])


def earlier(name: str, folder: Path, made_from: dict[str, Any]) -> BatchRow | None:
    """The row of a result that was made before from the same files; None where there is none, or it is damaged."""
    try:
        if json.loads((folder / MADE_FROM).read_text(encoding="utf-8")) != made_from:
            return None
        return _row(name, "done before", (folder / "diagnosis.json").read_bytes())
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def _row(name: str, state: str, content: bytes) -> BatchRow:
    """The row of a diagnosis.json, with the channel whose error is largest beside its noise."""
    record = json.loads(content)
    causes = "; ".join(f"{f['effect']} at {f['location']}" for f in record["findings"])

    def size(item: tuple[str, dict[str, Any]]) -> float:
        e = item[1]
        return (e["rms_before"] or 0.0) / (e["noise_floor"] or e["rms_after"] or 1.0)

    channel, e = max(record["held_out"].items(), key=size)
    row = BatchRow(
        name, state, record["verdict"], causes, channel, e["rms_before"], e["rms_after"], e["noise_floor"], e["unit"]
    )
    return replace(row, warning="; ".join(record["implausible"]))


def _one_line(text: str) -> str:
    return " ".join(text.split())
