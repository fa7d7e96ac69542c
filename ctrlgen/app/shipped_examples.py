"""The scenarios and recordings that come with the package, and a copy of some of them to work on."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import read_toml, write_bytes
from ctrlgen.core.names import meant
from ctrlgen.core.shipped_files import shipped

SCENARIO = "scenario.toml"


@dataclass(frozen=True)
class Example:
    """A folder of `scenarios/`: a scenario or a recording, and the device that it needs, which may stand beside it.

    `file` is its scenario or first recording; `complete` is False where the measured data are not part of the package.
    """

    name: str
    title: str
    file: Path
    device: Path

    @property
    def recorded(self) -> bool:
        """Whether it is a recording, to be diagnosed."""
        return self.file.name != SCENARIO

    @property
    def complete(self) -> bool:
        """Whether all data that it names are part of the package."""
        records = read_toml(self.file).get("record", [])
        return all((self.file.parent / record["file"]).is_file() for record in records)

    @property
    def files(self) -> list[Path]:
        """Everything it consists of, the device included."""
        paths = {path for path in self.file.parent.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
        return sorted(paths | {self.device})

    def command(self, folder: Path) -> str:
        """What to type to try its copy in `folder`."""
        copy, device = folder / self.name, folder / self.device.relative_to(self.file.parent.parent)
        tried = ["diagnose", device, copy / self.file.name] if self.recorded else ["run", copy]
        return shlex.join(map(str, ["ctrlgen", *tried, "--out", Path("out") / self.name]))


def examples() -> list[Example]:
    """All shipped examples, sorted by name."""
    listed = []
    for folder in sorted(path for path in shipped("scenarios").iterdir() if path.is_dir()):
        tables = {path: read_toml(path) for path in sorted(folder.glob("*.toml"))}
        scenario = folder / SCENARIO
        records = [path for path, table in tables.items() if "record" in table]
        if scenario in tables:
            device = Path(scenario.parent / tables[scenario]["device"]).resolve()
            listed.append(Example(folder.name, tables[scenario]["title"], scenario.resolve(), device))
        elif records:
            first = next((path for path in records if path.name == "recording.toml"), records[0])
            device = _device(folder, tables[first]["device"])
            listed.append(Example(folder.name, tables[first]["title"], first.resolve(), device))
    return listed


def _device(folder: Path, name: str) -> Path:
    """The device file of that name: the recording's own, or one that several share."""
    candidates = [*folder.glob("device.toml"), *sorted((folder.parent / "devices").glob("*.toml"))]
    return next(path for path in candidates if read_toml(path).get("name") == name).resolve()


def copy_examples(names: Sequence[str], to: Path) -> list[Path]:
    """Copies the named examples into the folder `to`, as they stand in `scenarios/`; the files written.

    Raises InputError for an unknown name, and where a file of another content is in the way; nothing is written then.
    """
    known = {example.name: example for example in examples()}
    if unknown := [name for name in names if name not in known]:
        raise InputError("example", [Fault(name, _unknown(name, known)) for name in unknown])
    copies: dict[Path, Path] = {}
    for name in names:
        example = known[name]
        copies |= {to / path.relative_to(example.file.parent.parent): path for path in example.files}
        if (to / name).exists():
            raise InputError("--to", [Fault(str(to / name), "exists; name another folder, or move it away")])
    for copy, original in copies.items():
        if copy.exists() and copy.read_bytes() != original.read_bytes():
            what = "exists and is not the example's; name another folder, or move it away"
            raise InputError("--to", [Fault(str(copy), what)])
    for copy, original in copies.items():
        write_bytes(copy, original.read_bytes())
    return list(copies)


def _unknown(name: str, known: Iterable[str]) -> str:
    return f"is not an example; {meant(name, known, 'ctrlgen example lists them')}"
