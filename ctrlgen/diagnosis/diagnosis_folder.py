"""The whole diagnosis from files to a folder with report.html, diagnosis.json and device.next.toml, written as a whole or not at all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ctrlgen.core.counts import number_of
from ctrlgen.core.files import whole_folder, write_text
from ctrlgen.core.one_or_several import several
from ctrlgen.core.steps import noted
from ctrlgen.devices import Device, files_of, load_device
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.evidence.bootstrap import Bootstrap, bootstrap
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.diagnosis_record import Provenance, diagnosis_record
from ctrlgen.diagnosis.report.html_report import page
from ctrlgen.diagnosis.report.writeback import write_next
from ctrlgen.diagnosis.selection.search_result import SearchResult
from ctrlgen.effects import installed
from ctrlgen.estimation.checkpoint import Checkpoint
from ctrlgen.estimation.simulator import compiled_simulator
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.plausibility import with_plausibility
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.recordings.recorded_files import recording_files, sha256
from ctrlgen.recordings.recording import Recording
from ctrlgen.reporting.result_file import json_text
from ctrlgen.version import code_hash

Progress = Callable[[str], None]
Paths = Path | str | Sequence[Path | str]


@dataclass(frozen=True)
class Replicates:
    """Number of bootstrap replicates, and where they run (see `ctrlgen.core.parallel`)."""

    count: int
    scheduler: str | None = None
    jobs: int | None = None

    def of(self, search: SearchResult, seed: int, step: Progress) -> Bootstrap:
        """The bootstrap of the chosen model; `step` is called with its progress."""
        step(f"bootstrap, {number_of(self.count, 'replicate')}")

        def told(done: int, of: int) -> None:
            step(f"bootstrap, {done} of {number_of(of, 'replicate')}")

        return bootstrap(search, self.count, seed, self.scheduler, self.jobs, told)


def diagnose(
    device: Device | Path | str,
    recording: Recording | Paths,
    seed: int = 0,
    progress: Progress | None = None,
    checkpoint: Checkpoint | None = None,
    laws: str | Sequence[str] | None = None,
    jobs: int | None = None,
) -> Diagnosis:
    """The physics that `recording` shows and `device` leaves out; each may be an object or its file, a recording also several.

    Deterministic for a given `seed`, whatever the number of processes, `jobs`: one per core unless given, 0 for this one alone.
    `progress` is called with a sentence before each step. `laws` restricts the hypotheses to the effects of these names (or of one)
    and the device's own parameters. Raises InputError.
    """
    device = device if isinstance(device, Device) else load_device(device)
    if not isinstance(recording, Recording):
        if progress:
            progress("reading")
        model = build_model(device)
        recording = with_plausibility(load_recordings(recording, model), model)
    chosen = None if laws is None else several(laws)
    return diagnose_recording(device, recording, seed, progress, checkpoint, chosen, jobs)


def diagnose_into(
    device: Path | str,
    recordings: Paths,
    out: Path | str,
    seed: int = 0,
    progress: Progress | None = None,
    replicates: Replicates | None = None,
    laws: str | Sequence[str] | None = None,
    jobs: int | None = None,
) -> Diagnosis:
    """`diagnose`, reported into the folder `out`, which is replaced as a whole or left unchanged. Raises InputError.

    An interrupted diagnosis leaves its fits in a file beside `out`; the same call continues from them. With `replicates`
    bootstrap.json is written too, and the diagnosis holds it as `bootstrap`.
    """
    recordings = several(recordings)
    with whole_folder(Path(out)) as draft:
        step = noted(draft, progress)
        model = build_model(load_device(device))
        step("reading")
        recording = with_plausibility(load_recordings(recordings, model), model)
        laws = None if laws is None else several(laws)
        checkpoint = _checkpoint(Path(out), device, recordings, seed, laws)
        if checkpoint.reused:
            step(f"continuing after {checkpoint.reused} fits")
        diagnosis = diagnose(model.device, recording, seed, step, checkpoint, laws, jobs)
        if replicates is not None:
            diagnosis = replace(diagnosis, bootstrap=replicates.of(diagnosis.search, seed, step))
        if diagnosis.bootstrap is not None:
            write_text(draft / "bootstrap.json", json_text(diagnosis.bootstrap))
        step("report")
        write_next(diagnosis, Path(device), draft / "device.next.toml")
        experiment = diagnosis.next_experiment
        for name, content in experiment.files.items() if experiment is not None and experiment.offered else ():
            write_text(draft / "next_experiment" / name, content)
        provenance = Provenance(digests(Path(device), recordings), seed)
        write_text(draft / "diagnosis.json", json_text(diagnosis_record(diagnosis, provenance)))
        write_text(draft / "report.html", page(diagnosis, provenance))
    # only now: a diagnosis interrupted during its replicates need not repeat its fits
    checkpoint.done()
    # Those of a hexapod take 20 MB each
    compiled_simulator.cache_clear()
    return diagnosis


def unfinished(out: Path) -> Path:
    """The checkpoint file of a diagnosis into `out`; it exists until the diagnosis is done."""
    # "." has no name of its own
    out = out.resolve()
    return out.with_name(f"{out.name}.unfinished")


def _checkpoint(
    out: Path, device: Path | str, recordings: Sequence[Path | str], seed: int, laws: Sequence[str] | None
) -> Checkpoint:
    """The checkpoint of a diagnosis into `out`, valid for the same program, files, seed and effects."""
    files = digests(Path(device), recordings)
    return Checkpoint(
        unfinished(out),
        {"code": code_hash() + installed().digest, "seed": seed, "laws": laws and sorted(laws), "files": files},
    )


def digests(device: Path, recordings: Sequence[Path | str]) -> dict[str, str]:
    """SHA-256 of every file that a diagnosis reads, by name."""
    device_files = [(file.name, file) for file in files_of(device)]
    return {name: sha256(path) for name, path in (*device_files, *recording_files(recordings))}
