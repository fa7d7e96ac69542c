"""Writes the reference pages from what the program itself reads and prints: schemas, laws, settings, `--help`."""

from __future__ import annotations

import ast
import inspect
import itertools
import json
import math
import re
from pathlib import Path
from typing import Any

from conventions_figure import draw_conventions
from pydantic import BaseModel

from ctrlgen.reporting.described_schema import DescribedSchema

OUT = Path(__file__).resolve().parents[1] / "reference" / "generated"
PASSED_OVER = ("effect", "sensor", "machine")  # tables that every device file may have: on their own page


def setup(app: Any) -> dict[str, Any]:
    """Sphinx calls this once; the pages are written before it looks for them."""
    app.connect("config-inited", lambda *_: (write_all(), draw_conventions(OUT.parents[1] / "_static")))
    app.connect("autodoc-process-docstring", literal_docstring)
    return {"parallel_read_safe": True}


def literal_docstring(app: Any, what: str, name: str, member: Any, options: Any, lines: list[str]) -> None:
    """Docstrings are plain text with `names`: a name becomes a literal, a bar stays a bar."""
    text = re.sub(r"(?<!`)`([^`]+)`(?!`)", r"``\1``", "\n".join(lines))
    parts = re.split(r"(``.+?``)", text, flags=re.DOTALL)
    parts[::2] = [re.sub(r"([|*_])", r"\\\1", part) for part in parts[::2]]
    lines[:] = "".join(parts).split("\n")


def write_all() -> None:
    """Writes every generated page."""
    OUT.mkdir(parents=True, exist_ok=True)
    pages = {
        "devices": device_page(),
        "scenario": scenario_page(),
        "recording": recording_page(),
        "effects": effects_page(),
        "uncertainty": uncertainty_page(),
        "commands": commands_page(),
        "results": results_page(),
        "settings": settings_page(),
        "python": python_page(),
        "equations": equations_page(),
        "priors": priors_page(),
    }
    for name, text in pages.items():
        path = OUT / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:  # so that Sphinx reads only what is new
            path.write_text(text, encoding="utf-8")


def type_of(schema: dict[str, Any], definitions: dict[str, Any]) -> str:
    """What a value may be, in words: 'quantity, such as "1 um", > 0 um', 'one of "held", "linear"', 'table, see Loop'."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        section = definitions.get("prefix", "") + name
        return f"table, see [{name}](#{re.sub(r'[^a-z0-9_-]', '', section.lower().replace(' ', '-'))})"
    if "anyOf" in schema or "oneOf" in schema:
        options = schema.get("anyOf") or schema["oneOf"]
        return " or ".join(dict.fromkeys(type_of(o, definitions) for o in options if o.get("type") != "null"))
    if "allOf" in schema:
        return type_of(schema["allOf"][0], definitions)
    if "x-unit" in schema:
        unit = schema["x-unit"]
        if unit == "any":
            return "quantity with its unit" + (", > 0" if schema.get("x-bounds") else "")
        number = "count" if schema.get("x-whole") else "number" if unit == "1" else f'quantity, such as `"1 {unit}"`'
        bounds = schema.get("x-bounds", "")
        return number + (f", {bounds}" if bounds else "")
    if "const" in schema:
        return f"`{json.dumps(schema['const'])}`"
    if "enum" in schema:
        return "one of " + ", ".join(f"`{json.dumps(value)}`" for value in schema["enum"])
    if schema.get("type") == "array":
        members = schema.get("prefixItems")
        if members:
            return f"list of {len(members)}: {type_of(members[0], definitions)}"
        length = schema.get("minItems") if schema.get("minItems") == schema.get("maxItems") else None
        member = type_of(schema.get("items", {}), definitions).replace("table, see", "tables, see")
        return f"list of {length}: {member}" if length else f"list of {member}"
    if schema.get("type") == "object" and isinstance(schema.get("additionalProperties"), dict):
        return f"table of names, each with a value: {type_of(schema['additionalProperties'], definitions)}"
    limits = [f"{sign} {schema[key]}" for key, sign in (("minimum", ">="), ("maximum", "<=")) if key in schema]
    word = {"string": "text", "integer": "whole number", "boolean": "true or false", "number": "number"}
    return ", ".join([word.get(schema.get("type", ""), schema.get("type", "any value")), *limits])


def table_of(schema: dict[str, Any], definitions: dict[str, Any]) -> list[str]:
    """A table of keys, one row a key, of a file that a user writes."""
    required = set(schema.get("required", ()))
    rows = ["| key | value | if left out | meaning |", "|---|---|---|---|"]
    for key, value in schema.get("properties", {}).items():
        default = value.get("default")
        nothing = default in (None, "", [], {}, ()) or isinstance(default, dict)  # a table then has its own defaults
        shown = "must be given" if key in required else "-" if nothing else f"`{json.dumps(default)}`"
        meaning = value.get("description", "")
        rows.append(f"| `{key}` | {cell(type_of(value, definitions))} | {cell(shown)} | {cell(meaning)} |")
    return rows


def result_table(schema: dict[str, Any], definitions: dict[str, Any]) -> list[str]:
    """The same for a file that the program writes: every key is there, some are null."""
    rows = ["| key | value | meaning |", "|---|---|---|"]
    for key, value in schema.get("properties", {}).items():
        null = " or null" if {"type": "null"} in value.get("anyOf", ()) else ""
        kind, meaning = type_of(value, definitions) + null, value.get("description", "")
        rows.append(f"| `{key}` | {cell(kind)} | {cell(meaning)} |")
    return rows


def cell(text: str) -> str:
    """Text that may stand in a table."""
    return " ".join(str(text).split()).replace("|", "\\|")


def sourced(path: Path) -> list[tuple[str, str, str]]:
    """(equation or section, function, first sentence) of what a file of `ctrlgen/physics/` takes from the papers."""
    rows = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            text = " ".join((ast.get_docstring(node) or "").split())
            for paper, where in re.findall(CITED, text):
                rows.append((f"{paper} {where.strip(' .,;:')}", node.name, re.split(r"(?<=\.) ", text)[0][:160]))
    return rows


EQUATIONS = r"eqs?\. \([\d.]+\)(?:(?:-|, | and )\([\d.]+\))*"
CITED = rf"(S[0-3]) ({EQUATIONS}|[A-C]\.\d+(?:-[A-C]\.\d+)?|Table \d+|section [\d.]+|Appendix [A-C][\d.]*)"


def equations_page() -> str:
    """Where each equation of the papers is stated, from the docstrings of `ctrlgen/physics/`."""
    package = Path(inspect.getfile(__import__("ctrlgen"))).parent
    rows = {
        (place, f"ctrlgen/physics/{path.name}", name, what)
        for path in sorted((package / "physics").glob("*.py"))
        for place, name, what in sourced(path)
    }

    def in_order(row: tuple[str, ...]) -> tuple[Any, ...]:
        return row[0][:2], [int(n) for n in re.findall(r"\d+", row[0][2:])], row

    lines = [
        GENERATED,
        "# Equations of the papers",
        "",
        "S0 to S3 are the papers that describe the devices; [the conventions](../../conventions.md) name them.",
        "",
        "| equation | file | function | what it gives |",
        "|---|---|---|---|",
    ]
    lines += [
        f"| {place} | `{file}` | `{name}` | {cell(what)} |" for place, file, name, what in sorted(rows, key=in_order)
    ]
    return "\n".join([*lines, ""])


def priors_page() -> str:
    """What the search believes of each law before it sees data, from `ctrlgen/estimation/priors.py`."""
    from ctrlgen.effects import Effect
    from ctrlgen.estimation import priors

    lines = [
        GENERATED,
        "# Priors of the laws",
        "",
        "What the diagnosis believes of each [law](effects.md) before it sees a recording; "
        "`ctrlgen/estimation/priors.py` states it.",
        "",
        "- *Odds*: how many times commoner the law is than a wrong gain; it decides among causes that explain alike.",
        "- *Form error*: what the law's form leaves after its parameters are fitted, as a share of what the law explains.",
        "- *Form of*: the physics of which several laws are forms. A place has at most one form of it.",
        "- *Plainer law*: what this law is where the numbers by which both differ are neutral; it is named instead where their "
        "intervals do not exclude that.",
        "",
        "| law | odds | form error | form of | plainer law | reason |",
        "|---|---|---|---|---|---|",
    ]
    for kind, law in sorted(Effect.library.items()):
        prior = priors.prior_of(law)
        plainer = f"`{law.plainer.kind}`" if law.plainer else ""
        odds, error = f"{math.exp(prior.log_prior_odds):.2g}", f"{100 * prior.model_form_error:g} %"
        lines.append(f"| `{kind}` | {odds} | {error} | {prior.form_of or ''} | {plainer} | {cell(prior.reason)} |")
    return "\n".join([*lines, ""])


def model_section(
    model: type[BaseModel], title: str, level: int = 2, passed_over: tuple[str, ...] = (), prefix: str = ""
) -> list[str]:
    """A schema as tables: the file itself, then every table in it."""
    schema = model.model_json_schema(schema_generator=DescribedSchema)
    definitions = dict(schema.get("$defs", {}), prefix=prefix)
    schema["properties"] = {k: v for k, v in schema["properties"].items() if k not in passed_over}
    lines = [
        f"{'#' * level} {title}",
        "",
        inspect.cleandoc(model.__doc__ or ""),
        "",
        *table_of(schema, definitions),
        "",
    ]
    for name in reachable(schema["properties"], definitions):
        section = definitions[name]
        lines += [
            f"{'#' * (level + 1)} {prefix}{name}",
            "",
            section.get("description", ""),
            "",
            *table_of(section, definitions),
            "",
        ]
    return lines


def reachable(node: Any, definitions: dict[str, Any], seen: list[str] | None = None) -> list[str]:
    """Names of the tables that `node` refers to, in the order in which a reader meets them."""
    seen = [] if seen is None else seen
    if isinstance(node, dict):
        if "$ref" in node:
            name = node["$ref"].rpartition("/")[2]
            if name not in seen:
                seen.append(name)
                reachable(definitions[name], definitions, seen)
        for value in node.values():
            reachable(value, definitions, seen)
    elif isinstance(node, list):
        for value in node:
            reachable(value, definitions, seen)
    return seen


GENERATED = "<!-- generated by docs/_ext/reference_pages.py -->\n"


def device_page() -> str:
    """Every kind of device, with its tables."""
    from ctrlgen.devices import Device
    from ctrlgen.devices.machine import Machine
    from ctrlgen.devices.sensor import DisplacementSensor, InterferometerSensor

    lines = [
        GENERATED,
        "# device.toml",
        "",
        "A device file describes one stage: `kind` chooses the equations, `name` is a C identifier, `title` and `source` are "
        "for readers. Every number is text with its unit, or a table "
        '`{ value = "40 um", sd = "0.5 um", source = "data sheet" }`: `sd` is the standard deviation of what is not known '
        'exactly, a difference or a share of the value (`"3 %"`), '
        "`source` where the number comes from. Unknown keys are errors; all faults of a file are reported at once.",
        "",
        "Any device file may hold `[[sensor]]` tables, `[[effect]]` tables for the [physical effects](effects.md) that "
        "its kind leaves out, `[[recording_effect]]` tables for those that one recording had alone, and a `[machine]` table.",
        "",
    ]
    for kind, device in sorted(Device.library.items()):
        lines += model_section(device, f'kind = "{kind}"', passed_over=PASSED_OVER, prefix=f"{kind} ")
    lines += model_section(Machine, "[machine]", prefix="machine ")
    lines += ["## [[sensor]]", ""]
    for sensor in (DisplacementSensor, InterferometerSensor):
        lines += model_section(sensor, sensor.__name__, level=3, prefix=f"{sensor.__name__} ")
    return "\n".join(lines)


def scenario_page() -> str:
    """The page of scenario.toml."""
    from ctrlgen.trajectory.scenario_file import ScenarioFile

    return "\n".join([GENERATED, *model_section(ScenarioFile, "scenario.toml", level=1)])


def recording_page() -> str:
    """The page of recording.toml."""
    from ctrlgen.recordings.schema import RecordingFile

    return "\n".join([GENERATED, *model_section(RecordingFile, "recording.toml", level=1)])


def uncertainty_page() -> str:
    """The page of uncertainty.toml."""
    from ctrlgen.budget.uncertainty import UncertaintyFile

    return "\n".join([GENERATED, *model_section(UncertaintyFile, "uncertainty.toml", level=1)])


def effects_page() -> str:
    """Every law of the library: equation, parameters, source; and what the search believes of it."""
    from ctrlgen.effects import Effect

    lines = [
        GENERATED,
        "# Physical effects",
        "",
        "Each is one file in `ctrlgen/effects/`, written into a device file as an `[[effect]]` table with `kind`, `at` (the "
        'channel it acts on, or `"all"`, or those that measure one thing, such as `"all in rad"`), `of` for effects that couple two '
        "channels, and its parameters. In a unit, "
        "`channel` stands for the unit of the signal the effect acts on, `travel` for that of the stage displacement, "
        "`partner` for that of the other channel and `force` for that of the stage's force.",
        "",
    ]
    for kind, law in sorted(Effect.library.items()):
        lines += [f"## {kind}", "", f"Acts on: {law.place.value}. Source: {law.source}", "", "```text"]
        lines += [inspect.cleandoc(law.__doc__ or ""), "```", ""]
        lines += ["| parameter | unit | bounds | meaning |", "|---|---|---|---|"]
        for p in law.params:
            low, high = p.bounds
            lines.append(f"| `{p.name}` | {p.unit} | {low:g} … {high:g} | {cell(p.doc)} |")
        lines.append("")
    return "\n".join(lines)


def commands_page() -> str:
    """The `--help` of every command."""
    from typer.testing import CliRunner

    from ctrlgen.app.commands import cli

    runner, environment = CliRunner(), {"COLUMNS": "100", "NO_COLOR": "1", "TERM": "dumb"}
    lines = [GENERATED, "# Commands", "", *_help(runner, cli.app, [], environment)]
    for command in cli.app.registered_commands:
        name = command.name or command.callback.__name__.replace("_", "-")
        lines += [f"## ctrlgen {name}", "", *_help(runner, cli.app, [name], environment)]
    for group in cli.app.registered_groups:
        for command in group.typer_instance.registered_commands:
            words = [str(group.name), str(command.name or command.callback.__name__)]
            lines += [f"## ctrlgen {' '.join(words)}", "", *_help(runner, cli.app, words, environment)]
    return "\n".join(lines)


def _help(runner: Any, app: Any, words: list[str], environment: dict[str, str]) -> list[str]:
    shown = runner.invoke(app, [*words, "--help"], env=environment, prog_name="ctrlgen").output
    return ["```text", "\n".join(line.rstrip() for line in shown.strip().splitlines()), "```", ""]


def results_page() -> str:
    """The files that programs read, from their published JSON schemas."""
    from ctrlgen import reporting

    folder = Path(reporting.__file__).parent / "schemas"
    lines = [
        GENERATED,
        "# Result files",
        "",
        "`summary.json` (of `run` and `solve`), `build.json` (of `verify`), `diagnosis.json` (of `diagnose`), `budget.json` (of "
        "`budget`), `fastest.json` (of `fastest`) and `learning.json` (of `learn`) hold every "
        "result for programs. Each states the version of its schema, the program's version, the sha256 of its inputs and the "
        "seed. The JSON Schemas are shipped with the package in `ctrlgen/reporting/schemas/`.",
        "",
    ]
    for path in sorted(folder.glob("*.schema.json")):
        schema = json.loads(path.read_text(encoding="utf-8"))
        definitions = schema.get("$defs", {})
        lines += [f"## {path.name.removesuffix('.schema.json')}.json", "", schema.get("description", ""), ""]
        lines += [*result_table(schema, definitions), ""]
        for name in reachable(schema.get("properties", {}), definitions):
            section = definitions[name]
            lines += [f"### {name}", "", section.get("description", ""), "", *result_table(section, definitions), ""]
    return "\n".join(lines)


def settings_page() -> str:
    """The thresholds of the diagnosis, each with its reason, from `ctrlgen/estimation/settings.py` and `ctrlgen/diagnosis/settings/`."""
    from ctrlgen import estimation
    from ctrlgen.diagnosis import settings

    lines = [
        GENERATED,
        "# Settings of the diagnosis",
        "",
        "Every threshold, size and count of the diagnosis, from `ctrlgen/estimation/settings.py` and "
        "`ctrlgen/diagnosis/settings/`. *Judgement* marks a value that no derivation fixes: it was chosen on simulated "
        "recordings with known causes, and another of the same order would serve.",
        "",
    ]
    files = sorted(path for path in Path(inspect.getfile(settings)).parent.glob("*.py") if path.stem != "__init__")
    files = [*sorted(Path(inspect.getfile(estimation)).parent.glob("settings*.py")), *files]
    for path in files:
        lines += [f"## {'estimation' if path.stem == 'settings' else path.stem}", ""]
        for record in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(record, ast.ClassDef):
                lines += [f"### {record.name}", "", ast.get_docstring(record) or "", "", *settings_table(record), ""]
    return "\n".join(lines)


def settings_table(record: ast.ClassDef) -> list[str]:
    """One row a setting: its value and the docstring below it."""
    rows = ["| setting | value | meaning and reason |", "|---|---|---|"]
    for entry, after in itertools.pairwise(record.body):
        if isinstance(entry, ast.AnnAssign) and isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            value = re.sub(r"^field\(default_factory=lambda: (.*)\)$", r"\1", ast.unparse(entry.value or after.value))
            rows.append(f"| `{ast.unparse(entry.target)}` | `{cell(value)}` | {cell(after.value.value)} |")
    return rows


def python_page() -> str:
    """The public Python API: what `ctrlgen` exports."""
    import ctrlgen

    lines = [
        GENERATED,
        "# Python",
        "",
        "`import ctrlgen` gives these names. Numbers are SI; arrays are NumPy's, expressions CasADi's `SX`.",
        "",
        "```{eval-rst}",
    ]
    for name in ctrlgen.__all__:
        member = getattr(ctrlgen, name)
        if inspect.isclass(member):
            lines += [f".. autoclass:: {member.__module__}.{member.__qualname__}", "   :members:", ""]
        elif callable(member):
            lines += [f".. autofunction:: {member.__module__}.{member.__qualname__}", ""]
    return "\n".join([*lines, "```", ""])
