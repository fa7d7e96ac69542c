"""What the documentation shows works: files are written as captioned, Python runs, commands end well."""

from __future__ import annotations

import dataclasses
import html
import importlib
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import ROOT
from markdown_it import MarkdownIt

from ctrlgen.app.batch import BatchFile
from ctrlgen.app.write_schemas import RESULTS
from ctrlgen.budget.uncertainty import UncertaintyFile
from ctrlgen.devices import Device
from ctrlgen.devices.sensor import DisplacementSensor, InterferometerSensor
from ctrlgen.diagnosis import settings
from ctrlgen.effects import Effect
from ctrlgen.estimation import settings as estimation_settings
from ctrlgen.recordings.schema import RecordingFile
from ctrlgen.reporting.described_schema import DescribedSchema
from ctrlgen.trajectory.scenario_file import ScenarioFile

DOCS = ROOT / "docs"
# Pages that build on files of the pages before them; the first diagnosis has a test of its own
IN_ORDER = {
    "device": ["tutorial/first_device.md"],
    "mechanism": ["howto/own_mechanism.md"],
}


def blocks(page: str) -> list[tuple[str, str, str]]:
    """(language, caption, text) of every code block of a page, in order; a caption is the file's name."""
    found = []
    for token in MarkdownIt().parse((DOCS / page).read_text(encoding="utf-8")):
        if token.type != "fence":
            continue
        info, text, caption = token.info.strip(), token.content, ""
        if info.startswith("{code-block}"):
            while text.startswith(":"):
                option, _, text = text.partition("\n")
                caption = option.removeprefix(":caption:").strip() if option.startswith(":caption:") else caption
            info, text = "shown", text.removeprefix("\n")
        found.append((info, caption, text))
    return found


def follow(pages: list[str], folder: Path) -> int:
    """Does what the pages say, in `folder`; how many blocks were run."""
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    run = 0
    for page in pages:
        for language, caption, text in blocks(page):
            if caption:
                (folder / caption).write_text(text, encoding="utf-8")
            commands = [[sys.executable, "-c", text]] if language == "python" else []
            if language == "console":
                lines = text.splitlines()
                assert all(line.startswith("$ ") for line in lines), (page, text)
                commands = [shlex.split(line[2:]) for line in lines]
            for command in commands:
                done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
                assert done.returncode == 0, (page, command, done.stdout, done.stderr)
                run += 1
    return run


@pytest.mark.long
@pytest.mark.parametrize("name", IN_ORDER)
def test_what_a_page_tells_the_reader_to_do_works(name, tmp_path):
    assert follow(IN_ORDER[name], tmp_path) > 0


@pytest.mark.long
def test_the_first_firmware_works(tmp_path):
    assert follow(["tutorial/first_firmware.md"], tmp_path) > 0
    assert (tmp_path / "out" / "circle20" / "report.html").is_file()
    shown = [text for language, _, text in blocks("tutorial/first_firmware.md") if language == "c"]
    headers = "".join(path.read_text(encoding="utf-8") for path in (tmp_path / "out" / "circle20" / "c").glob("*.h"))
    names = {name for text in shown for name in re.findall(r"\w+_online_\w+", text)}
    assert names and all(re.search(rf"\b{name}\b", headers) for name in names)


@pytest.mark.long
def test_the_first_diagnosis_finds_what_the_page_says(tmp_path):
    follow(["tutorial/first_device.md", "tutorial/first_diagnosis.md"], tmp_path)
    shown = next(text for language, _, text in blocks("tutorial/first_diagnosis.md") if language == "text")
    found = (tmp_path / "diagnosis" / "diagnosis.json").read_text(encoding="utf-8")
    assert "stiffening" in shown and '"stiffening"' in found and '"explained"' in found
    page = (tmp_path / "diagnosis" / "report.html").read_text(encoding="utf-8")
    told = " ".join(html.unescape(page).split())
    for line in shown.splitlines():
        assert line.removesuffix(" …") in told
        assert line in (ROOT / "README.md").read_text(encoding="utf-8")


def test_every_page_is_in_the_contents():
    listed = (DOCS / "index.md").read_text(encoding="utf-8").split()
    pages = {path.relative_to(DOCS).with_suffix("").as_posix() for path in DOCS.rglob("*.md")} - {"index"}
    assert pages <= {*listed, *(page for page in pages if page.startswith("reference/generated"))}


FILES = [
    *Device.library.values(),
    DisplacementSensor,
    InterferometerSensor,
    ScenarioFile,
    RecordingFile,
    BatchFile,
    UncertaintyFile,
]


@pytest.mark.parametrize("file", [*FILES, *RESULTS.values()], ids=lambda model: model.__name__)
def test_every_key_of_a_file_has_a_description(file):
    """The reference pages are made of them."""
    mode = "serialization" if file in RESULTS.values() else "validation"
    schema = file.model_json_schema(schema_generator=DescribedSchema, mode=mode)
    tables = {file.__name__: schema, **schema.get("$defs", {})}
    keys = [(name, key, entry) for name, table in tables.items() for key, entry in table.get("properties", {}).items()]
    assert keys
    assert [f"{name}.{key}" for name, key, entry in keys if not entry.get("description", "").strip()] == []


def test_the_pages_of_settings_and_priors_hold_every_entry(monkeypatch):
    """The pages are read from source files, which can move."""
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    pages = importlib.import_module("reference_pages")
    rooms = {**vars(estimation_settings), **vars(settings)}
    records = [record for record in rooms.values() if dataclasses.is_dataclass(record) and not isinstance(record, type)]
    named = {entry.name for record in records for entry in dataclasses.fields(record)}
    assert named and named == set(re.findall(r"^\| `(\w+)` ", pages.settings_page(), re.MULTILINE))
    assert set(Effect.library) == set(re.findall(r"^\| `(\w+)` ", pages.priors_page(), re.MULTILINE))


# `make docs`, which .ci/run runs, does the same
@pytest.mark.exhaustive
def test_the_documentation_builds_without_a_warning(tmp_path):
    """Links between pages, to files and to functions included."""
    pytest.importorskip("sphinx", reason="the documentation's generator is not installed: pip install '.[docs]'")
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", str(DOCS), str(tmp_path)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def test_the_thresholds_that_the_method_names_are_in_the_settings():
    text = (DOCS / "method" / "diagnosis.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([A-Z][A-Z_]+)\.(\w+)`", text))
    assert len(named) > 20
    assert not {
        f"{record}.{name}"
        for record, name in named
        if not any(hasattr(getattr(room, record, None), name) for room in (estimation_settings, settings))
    }


def test_the_modules_that_the_method_names_exist():
    text = (DOCS / "method" / "diagnosis.md").read_text(encoding="utf-8")
    named = {path.split("/")[-1] for path in re.findall(r"`([\w/]+\.py)`", text)}
    assert len(named) > 20 and named <= {path.name for path in (ROOT / "ctrlgen").rglob("*.py")}


def test_every_file_that_a_page_names_is_there():
    """Below the root, the package, or the folder of the diagnosis, of which one page tells."""
    below = (ROOT, ROOT / "ctrlgen", ROOT / "ctrlgen" / "diagnosis")
    pages = [page for page in DOCS.rglob("*.md") if "generated" not in page.parts]
    named = [
        (page, path) for page in pages for path in re.findall(r"`([a-z_]+/[\w/]+\.(?:py|c|h|j2))`", page.read_text())
    ]
    assert len(named) > 100
    assert not [(page.name, path) for page, path in named if not any((folder / path).is_file() for folder in below)]
