"""Work that is going on, or was stopped, in the shown folders: read from what it leaves there while it writes.

| what is there | what it is |
|---|---|
| `.NAME.xxxxxxxx/` with `.steps` | a result that is being written into NAME (`ctrlgen.core.files.whole_folder`) |
| `NAME.unfinished` | the fits so far of a diagnosis into NAME (`ctrlgen.estimation.checkpoint`) |
| `batch.json` | a batch: how many of how many diagnoses are done |
| `cases/` and `results/` | cases with a result each: how many have theirs |
"""

from __future__ import annotations

import os
import re
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

from ctrlgen.app.viewer.result_answers import BATCH
from ctrlgen.app.viewer.viewed_folders import Place, ViewedFolders, read_record
from ctrlgen.core.steps import STEPS, Steps, read_steps

DRAFT = re.compile(r"^\.(?P<name>.+)\.[A-Za-z0-9_]{8}$")  # as tempfile names it
CHECKPOINT = ".unfinished"
QUIET = 600  # seconds without a change after which work whose process is not known counts as stopped: a step takes a minute or two
LAST_STEPS = 40
DONE_CASE = "run.json"  # in the folder of each result of a battery


@dataclass(frozen=True)
class Job:
    """Work into the folder `place`: `state` is "runs", "stopped" or "done".

    `steps` are (time, text), the last ones; `fits` counts those that a stopped diagnosis goes on from; `done` of `total` pieces where
    they are counted; `files` are (name, bytes) that are written already; `changed`: the last change [s since 1970].
    """

    place: Place
    name: str
    state: str
    began: float = 0.0
    changed: float = 0.0
    steps: tuple[tuple[float, str], ...] = ()
    fits: int | None = None
    done: int | None = None
    total: int | None = None
    files: tuple[tuple[str, int], ...] = field(default=())


def followed_jobs(folders: ViewedFolders) -> list[Job]:
    """All work that is going on or was stopped, the last changed first."""
    jobs: dict[Place, Job] = {}
    for place, inside in folders.walk():
        disk = folders.roots[place.root].joinpath(*place.parts)
        names = {entry.name: entry for entry in inside}
        for name, entry in names.items():
            draft = DRAFT.match(name)
            if draft and entry.is_dir(follow_symlinks=False):
                _add(jobs, _of_draft(place.below(draft["name"]), disk / name))
            elif name.endswith(CHECKPOINT) and entry.is_file(follow_symlinks=False):
                _add(jobs, _of_checkpoint(place.below(name.removesuffix(CHECKPOINT)), disk / name))
        _add(
            jobs,
            _of_batch(place, disk)
            if BATCH in names
            else _of_cases(place, disk)
            if {"cases", "results"} <= set(names)
            else None,
        )
    there = [replace(job, name="/".join(job.place.parts) or folders.name(job.place.root)) for job in jobs.values()]
    return sorted((job for job in there if job.state != "done"), key=lambda job: (-job.changed, job.place.parts))


def _add(jobs: dict[Place, Job], job: Job | None) -> None:
    """Adds what one file tells of a job to what others told; of two drafts of one result the newer counts."""
    if job is None:
        return
    known = jobs.get(job.place)
    if known is None:
        jobs[job.place] = job
        return
    newer, older = (job, known) if (job.began, job.changed) > (known.began, known.changed) else (known, job)
    fits = older.fits if newer.fits is None else newer.fits
    state = newer.state if newer.steps or not older.steps else older.state
    jobs[job.place] = replace(newer, state=state, fits=fits, changed=max(job.changed, known.changed))


def _of_draft(place: Place, disk: Path) -> Job | None:
    """A folder that is being written; None where it is none of ours or is gone."""
    files, changed = [], 0.0
    try:
        for path in sorted(disk.rglob("*"))[:1000]:
            about = path.lstat()
            changed = max(changed, about.st_mtime)
            if path.is_file() and path.name != STEPS:
                files.append((path.relative_to(disk).as_posix(), about.st_size))
        steps = read_steps(disk)
    except OSError:
        return None
    if steps is None:
        return None
    return Job(place, "", _state(steps, changed), steps.began, changed, steps.steps[-LAST_STEPS:], files=tuple(files))


def _state(steps: Steps, changed: float) -> str:
    runs = time.time() - changed < QUIET if steps.runs is None else steps.runs
    return "runs" if runs else "stopped"


def _of_checkpoint(place: Place, disk: Path) -> Job | None:
    """The fits of a diagnosis that is not done: one line each after a header."""
    try:
        about = disk.stat()
        with disk.open("rb") as file:
            lines = sum(chunk.count(b"\n") for chunk in iter(lambda: file.read(1 << 20), b""))
    except OSError:
        return None
    quiet = time.time() - about.st_mtime > QUIET
    return Job(place, "", "stopped" if quiet else "runs", changed=about.st_mtime, fits=max(0, lines - 1))


def _of_batch(place: Place, disk: Path) -> Job | None:
    """A batch: its own count of what is done."""
    try:
        record = read_record(disk / BATCH)
        done, total, changed = int(record["done"]), int(record["total"]), (disk / BATCH).stat().st_mtime
    except (OSError, ValueError, KeyError, TypeError):
        return None
    state = "done" if done >= total else "stopped" if time.time() - changed > QUIET else "runs"
    return Job(place, "", state, changed=changed, done=done, total=total)


def _of_cases(place: Place, disk: Path) -> Job | None:
    """Cases, of which each gets a result."""
    try:
        total = sum(entry.is_dir() for entry in os.scandir(disk / "cases"))
        kept = [entry.stat().st_mtime for entry in (disk / "results").glob(f"*/{DONE_CASE}")]
    except OSError:
        return None
    if not total:
        return None
    changed = max(kept, default=(disk / "results").stat().st_mtime)
    state = "done" if len(kept) >= total else "stopped" if time.time() - changed > QUIET else "runs"
    return Job(place, "", state, changed=changed, done=len(kept), total=total)
