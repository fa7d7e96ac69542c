"""What makes generated C a package: README, manifests of build systems, inputs, hashes; and whether a package is unspoiled."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import read_text, write_text
from ctrlgen.core.units import base_unit
from ctrlgen.devices.signal import Signal
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import write
from ctrlgen.firmware.online.checksum import checksum_instructions
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.version import __version__, commit

if TYPE_CHECKING:
    from ctrlgen.firmware.player.compression import PlayerCandidate

MANIFEST = "manifest.json"
PIECES = ("online", "player", "selftest", "vectors")
LICENCE = "The generated code belongs to the user of ctrlgen who generated it; no warranty."
TEMPLATES = {
    "package/README.md": "README.md",
    "CMakeLists.txt": "CMakeLists.txt",
    "package/library.properties": "library.properties",
    "package/module.yml": "zephyr/module.yml",
    "package/zephyr.cmake": "zephyr/CMakeLists.txt",
    "package/Kconfig": "zephyr/Kconfig",
}


def owners(scenario: Scenario) -> dict[str, str]:
    """Piece -> what its files and functions are named after: the scenario, but for the controller, which knows no trajectory, the device,
    or the scenario's `controller`."""
    return dict.fromkeys(PIECES, scenario.name) | {"online": scenario.controller_name}


def write_package(
    out: Path,
    scenario: Scenario,
    contexts: Mapping[Real, dict[str, Any]],
    figures: Mapping[str, str],
    c: Iterable[Path],
) -> None:
    """Everything in `out` beside the files `c`: `contexts` are what their templates were filled with, `figures` name -> SVG text.

    The manifest comes last, with the hashes of all files written.
    """
    inputs = input_files(scenario)
    context = _context(scenario, contexts, figures, inputs)
    written = [*c, *(write(template, context, out / name) for template, name in TEMPLATES.items())]
    sketches = {f"{scenario.name}_selftest": f"{scenario.name}_selftest_{Real.FLOAT.suffix}"}
    if context["fixed"]:
        sketches[context["fixed"]["selftest"]] = context["fixed"]["selftest"]
    for sketch, tested in sketches.items():
        context_of = context | {"tested": tested}
        written.append(write("package/selftest.ino", context_of, out / "examples" / sketch / f"{sketch}.ino"))
    texts = {f"device/{path}": text for path, text in inputs.items()}
    texts |= {f"figures/{name}.svg": svg for name, svg in figures.items()}
    texts["library.json"] = json.dumps(_platformio(context), indent=2) + "\n"
    for name, text in texts.items():
        write_text(out / name, text)
        written.append(out / name)
    manifest = {
        "name": scenario.name,
        "title": context["title"],
        "ctrlgen": __version__,
        "commit": commit(),
        "licence": LICENCE,
        "inputs": scenario.digest,
        "files": {name: _sha256(out / name) for name in sorted(path.relative_to(out).as_posix() for path in written)},
    }
    write_text(out / MANIFEST, json.dumps(manifest, indent=1) + "\n")


def input_files(scenario: Scenario) -> dict[str, str]:
    """Relative path -> text of each input, placed so that the relative paths that the scenario states still lead there.

    `ctrlgen generate` on the copied scenario makes the same C again, unless the scenario names an absolute path or a
    device that is no file.
    """
    home = _absolute(scenario.path).parent.parent
    stated = {"device": scenario.file.device, "poses": getattr(scenario.file.path, "file", None) or ""}
    placed = {
        name: _absolute(read.path) for name, read in scenario.inputs.items() if not os.path.isabs(stated.get(name, ""))
    }
    base = Path(os.path.commonpath([home, *placed.values()]))
    return {
        (placed[name].relative_to(base) if name in placed else Path(read.path.name)).as_posix(): read.text
        for name, read in scenario.inputs.items()
    }


def verify_package(folder: Path | str) -> tuple[Fault, ...]:
    """What differs in a generated folder from its manifest; empty when nothing does.

    Files changed or missing, and C added at the root, which Arduino and PlatformIO would build; other files may be
    added, such as those of a build. Raises InputError when there is no manifest that can be read.
    """
    folder = Path(folder)
    try:
        expected = dict(json.loads(read_text(folder / MANIFEST))["files"])
    except (ValueError, KeyError, TypeError, RecursionError):
        raise InputError(
            folder / MANIFEST, [Fault("file", "is no manifest of ctrlgen; generate the folder anew")]
        ) from None
    faults = []
    for name, digest in expected.items():
        if not (folder / name).is_file():
            faults.append(Fault(name, "is missing; generate the folder anew"))
        elif _sha256(folder / name) != digest:
            faults.append(Fault(name, "was changed since it was generated; generate the folder anew"))
    added = sorted(path.name for path in folder.glob("*.[ch]") if path.name not in expected)
    return (*faults, *(Fault(name, "was added; keep files of your own elsewhere") for name in added))


def _absolute(path: Path) -> Path:
    return Path(os.path.abspath(path))  # not resolve(): a link's target may lie where its stated path does not lead


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _context(
    scenario: Scenario, contexts: Mapping[Real, dict[str, Any]], figures: Mapping[str, str], inputs: Mapping[str, str]
) -> dict[str, Any]:
    """What the templates of the package need: those of the float C, and what concerns both arithmetics."""
    c = contexts[Real.FLOAT]
    arrays: list[tuple[str, Signal]] = [("target", c["follow"]), ("out.drive", c["drive"])]
    if c["n_s"]:
        arrays.append(("out.state", c["state"]))
    return {
        **c,
        "name": scenario.name,
        "title": scenario.file.title,
        "device": scenario.device.name,
        "owners": owners(scenario),
        "builds": {real.suffix: contexts[real]["build"] for real in Real},
        "pieces": ["online", *(["player"] if c["player"] else []), "selftest", "vectors"],
        "arrays": arrays,
        "elements": lambda signal: [
            f"{a} [{base_unit(u)}]" for a, u in zip(signal.channels, signal.units, strict=True)
        ],
        # of a motion the derivatives are left at zero: it stays there
        "target": [v if k < c["positions"] else 0.0 for k, v in enumerate(c["rows"][0]["target"])],
        "period": f"{scenario.sample_time:.6g}" if scenario.sample_time else "",
        "memory": _memory(c, contexts),
        "checksum_cost": checksum_instructions(_memory(c, contexts)[0]["float"]),
        "vectors": c["calls"],
        "tolerance": {real.suffix: contexts[real]["tolerance"] for real in Real},
        "figures": list(figures),
        "inputs": list(zip(inputs, scenario.digest.values(), strict=True)),
    }


def _memory(c: dict[str, Any], contexts: Mapping[Real, dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of the README's table of memory, bytes in double and float."""
    x, n, nu, n_s = len(c["x_names"]), c["n"], c["nu"], c["n_s"]
    chosen: list[PlayerCandidate | None] = [contexts[real].get("chosen") for real in Real]
    rated = nu if c["rated"] else 0
    more = [rated, c["given_numbers"], len(c["ringing"].weights) + 1 if c["ringing"] else 0]
    more.append(x + n + 1 if c["times"] else 0)  # where the last sample began, and its time
    given = "".join(f" + {count}" for count in more if count)
    words = len(c["words"])
    told = "a word" if words == 1 else f"{words} words of 4 B"
    state = f"`sizeof({c['online']}_state)` = ({x} + {n}{given}) numbers and {told}, RAM, one a device"
    output = f"`sizeof({c['online']}_output)` = ({nu} + {n} + {n_s}) numbers, RAM or stack"
    rows = [
        # an odd word is aligned as a number
        _counted("state", x + n + sum(more) + words % 2, 4 * (words - words % 2), state),
        _counted("output", nu + n + n_s, 0, output),
        _vectors(contexts),
    ]
    if c["checked"]:
        formula = f"`sizeof({c['checked']}_state)` is 4 B more than the state (8 B in double), 256 constants of 4 B; only if it is called"
        rows.append({"what": "checksum", "float": 4 + 1024, "double": 8 + 1024, "formula": formula})
    if c["corrected"]:
        numbers, terms, sums = c["correction"]["numbers"], len(c["correction"]["terms"]), c["correction"]["sums"]
        formula = f"`sizeof({c['corrected']}_table)` = {numbers} numbers and 2 words, RAM, one a device"
        rows.append(_counted("correction", numbers, 8, formula))
        formula = f"`sizeof({c['corrected']}_run)` = {numbers + 5 * terms + sums} numbers and {terms + 4} words, RAM, only to learn"
        # words in an odd number are filled up in double
        rows.append(_counted("its learning", numbers + 5 * terms + sums, 4 * (terms + 4), formula))
        rows[-1]["double"] += 4 * (terms % 2)
    if c["played"]:
        forms = "; ".join(
            f"{real.value}: {kept.kind}, {kept.size}" for real, kept in zip(Real, chosen, strict=True) if kept
        )
        sizes = [kept.bytes if kept else 0 for kept in chosen]
        formula = f"constants, only if the player is called; {forms}"
        rows.insert(2, {"what": "player's table", "double": sizes[0], "float": sizes[1], "formula": formula})
    return rows


def _vectors(contexts: Mapping[Real, dict[str, Any]]) -> dict[str, Any]:
    """The row of the reference vectors. A call near a limit may be one of double alone, or of float: their numbers may differ."""
    row: dict[str, Any] = {"what": "vectors"}
    formulas = []
    for real in Real:
        c = contexts[real]
        m, nu, count, played, timed = c["m"], c["nu"], len(c["rows"]), len(c["played"]), len(c["timed"])
        turned = len(c["turned"])
        numbers = count * (m + nu) + turned * (3 * m + 3) + played * nu + timed * (nu + 1)
        row[real.value] = real.bytes * numbers + 12 * count + 4 * played
        formula = f"{count} x ({m} + {nu}) numbers and 3 x {count} integers of 4 B"
        formula += f", {turned} x (3 x {m} + 3) numbers" if turned else ""
        formulas.append(
            formula + (f", {played} x {nu} + {timed} x {nu + 1} numbers and {played} indices of 4 B" if played else "")
        )
    counted = (
        formulas[0]
        if len(set(formulas)) == 1
        else "; ".join(f"{r.value}: {f}" for r, f in zip(Real, formulas, strict=True))
    )
    return row | {"formula": f"{counted}, constants; only if the test is called"}


def _counted(what: str, numbers: int, extra: int, formula: str) -> dict[str, Any]:
    """A row for so many `numbers` of the arithmetic and `extra` bytes."""
    return {"what": what, "formula": formula, **{real.value: numbers * real.bytes + extra for real in Real}}


def _platformio(context: dict[str, Any]) -> dict[str, Any]:
    """library.json; only the C at the root is built, headers stand beside it."""
    return {
        "name": context["name"],
        "version": context["version"],
        "description": context["title"],
        "keywords": ["control", "feedforward", "inverse", "flexure", "positioning"],
        "authors": [{"name": "ctrlgen"}],
        "headers": [
            *(
                f"{context['owners'][piece]}_{piece}_f32.h"
                for piece in context["pieces"]
                if piece in ("online", "player")
            ),
            *([f"{context['fixed']['prefix']}.h"] if context["fixed"] else []),
        ],
        "frameworks": "*",
        "platforms": "*",
        "build": {"srcDir": ".", "includeDir": ".", "srcFilter": ["+<*.c>"]},
    }
