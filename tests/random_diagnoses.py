"""Cheap diagnoses of any kind, from a folder to the answer: what they state is held to the checker of contradictions.

    PYTHONPATH=.:tests python tests/random_diagnoses.py 1 100

prints a line a seed: kind of device, what was planted, verdict, findings, and each contradiction. Whether the answer is right is of no
matter here.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from random_recordings import Drawn, draw

from battery.consistency import contradictions
from battery.first_screen_check import screen_contradictions
from ctrlgen.core.errors import InputError
from ctrlgen.devices import Device, load_device
from ctrlgen.diagnosis.diagnosis_folder import diagnose
from ctrlgen.diagnosis.evidence.diagnosis_result import Diagnosis
from ctrlgen.diagnosis.report.diagnosis_first_screen import diagnosis_first_screen
from ctrlgen.diagnosis.report.diagnosis_record import Provenance, diagnosis_record
from ctrlgen.diagnosis.report.html_report import page
from ctrlgen.diagnosis.report.writeback import write_next
from ctrlgen.estimation.hypothesis import PARAMETER
from ctrlgen.reporting.result_file import json_text


@dataclass(frozen=True)
class Case:
    """What was drawn, and the answer with what contradicts itself in it."""

    drawn: Drawn
    found: Diagnosis
    wrong: tuple[str, ...]

    def __str__(self) -> str:
        found = ", ".join(f"{f.effect} at {f.location}" for f in self.found.findings)
        planted = " + ".join(self.drawn.planted)
        head = f"{self.drawn.kind}: {planted or 'nothing'} -> {self.found.verdict}: {found or 'nothing'}"
        return "\n".join([head, *(f"    CONTRADICTION {text}" for text in self.wrong)])


def case(seed: int, folder: Path, whole_page: bool = False) -> Case:
    """The case of a seed, its files in `folder`; with `whole_page` report.html too."""
    drawn = draw(seed, folder)
    device, to = folder / "device.toml", folder / "device.next.toml"
    found = diagnose(load_device(device), folder / "recording.toml", laws=drawn.laws, jobs=0)
    write_next(found, device, to)
    record = json.loads(json_text(diagnosis_record(found, Provenance({}, 0))))
    (folder / "diagnosis.json").write_text(json.dumps(record, indent=1))
    screen = diagnosis_first_screen(found, {})
    (folder / "screen.json").write_text(json.dumps([screen.answer, screen.numbers, screen.steps], indent=1))
    told = screen.answer, screen.numbers, screen.steps
    wrong = [
        *contradictions(record),
        *screen_contradictions(record, *told),
        *_not_written(found, load_device(to).in_recording(found.recording.title)),
    ]
    if whole_page:
        (folder / "report.html").write_text(page(found, Provenance({}, 0)))
    return Case(drawn, found, tuple(wrong))


def _not_written(found: Diagnosis, written: Device) -> Iterator[str]:
    """What of the accepted model device.next.toml does not hold."""
    effects = [(e.kind, e.at, e.of) for e in written.effect]
    for f in found.findings:
        if f.effect != PARAMETER and f.cause.at and (f.effect, f.cause.at, f.of) not in effects:
            yield f"device.next.toml has no {f.effect} at {f.cause.at}: {effects}"


if __name__ == "__main__":
    first, last, *kept = sys.argv[1:]
    for seed in range(int(first), int(last) + 1):
        with tempfile.TemporaryDirectory() as folder:
            place, begin = Path(kept[0], str(seed)) if kept else Path(folder), time.process_time()
            place.mkdir(parents=True, exist_ok=True)
            try:
                told = str(case(seed, place, whole_page=seed % 10 == 0))
            except InputError as error:
                told = f"refused: {error}"
            print(seed, f"{time.process_time() - begin:.1f} s", told, flush=True)
