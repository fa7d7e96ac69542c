"""Renders the templates in `codegen/templates/`."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import jinja2

from ctrlgen.core.compiled_templates import environment as templates
from ctrlgen.core.escaping import c_comment, c_format, kconfig, markdown, markdown_code, one_line
from ctrlgen.core.files import write_text
from ctrlgen.core.shipped_files import shipped
from ctrlgen.firmware.c.file_scope import prefixed
from ctrlgen.firmware.c.preprocessor import COMMENT, WORD
from ctrlgen.firmware.c.real import Real

# Of the interface of the generated C, in every header: raised when code that was written for an older header must be changed or compiled
# anew because a function, a structure (that of the state too) or the meaning of an argument or a status changed.
# tests/interface_digests.json holds the digest of the interface that belongs to the number.
ABI = 5
# Sources of a firmware and what of their context is their own name.
SOURCES = {
    "online.c": "prefix",
    "checked.c": "prefix",
    "corrected.c": "prefix",
    "fixed.c": "prefix",
    "fixed_selftest.c": "selftest",
    "fixed_vectors.c": "vectors",
    "player.c": "prefix",
    "plant.c": "prefix",
    "selftest.c": "selftest",
    "vectors.c": "vectors",
}


# A double of less than double precision; a tool that does not know <float.h> reads the source
NARROW = "#include <float.h>\n#if defined(DBL_MANT_DIG) && (DBL_MANT_DIG < 53)\n"


def codegen_folder() -> Path:
    """The folder of the C templates and of the test harness."""
    return shipped("codegen")


@cache
def words_of_c() -> frozenset[str]:
    """The words of the C into which the constants of a device are written, comments left out: no constant may have one for its name."""
    files = [*(codegen_folder() / "limiter").glob("*.c")]
    files += [codegen_folder() / "templates" / f"{name}.c.j2" for name in ("device", "elementary", "plant")]
    texts = (re.sub(r"\{[{%].*?[%}]\}", "", COMMENT.sub("", file.read_text(encoding="utf-8"))) for file in files)
    return frozenset(word for text in texts for word in WORD.findall(text))


def render(template: str, context: dict[str, Any]) -> str:
    """`template` of `codegen/templates/` with `context`. A name that the template asks for and does not get is an error. In a source of
    a firmware every name of file scope begins with that of the source."""
    text = _environment().get_template(f"{template}.j2").render(context)
    doubles, source = context.get("real") is Real.DOUBLE, f"{template.removesuffix('.h')}.c"
    if template not in SOURCES:
        return _refused(text) if doubles and source in SOURCES and template != source else text
    header = _environment().get_template(f"{template.removesuffix('.c')}.h.j2").render(context)
    text = prefixed(text, context[SOURCES[template]], header)
    return _left_out(text, context[SOURCES[template]]) if doubles else text


def _refused(header: str) -> str:
    """A header of the arithmetic in double, which a program refuses whose double is no double."""
    guard, _, rest = header.partition("_H\n#define ")
    name, _, rest = rest.partition("\n")
    check = f'{NARROW}#error "double has fewer than 53 bits here, as on AVR: take the controller of the suffix _f32"\n#endif\n'
    return f"{guard}_H\n#define {name}\n\n{check}{rest}"


def _left_out(source: str, name: str) -> str:
    """A source of the arithmetic in double, which is empty where a double is no double: Arduino builds every source of a library. It does
    not compile where an option reads its constants as float: drives were off by 6e-8 of themselves, and only the self test told."""
    about, _, rest = source.partition("*/\n")
    empty = f"typedef int {name}_left_out; /* double has fewer than 53 bits here, as on AVR: take the suffix _f32 */\n"
    wide = "#include <float.h>\n#if !defined(DBL_MANT_DIG) || (DBL_MANT_DIG >= 53)\n"
    check = (
        "/* compile this without -fsingle-precision-constant or -cl-single-precision-constant: they round every constant to float */\n"
        f"typedef char {name}_constants_in_double[(sizeof(1.0) == sizeof(double)) ? 1 : -1];\n"
    )
    return f"{about}*/\n{wide}{check}{rest}#else\n{empty}#endif\n"  # behind all that is included


@cache
def _environment() -> jinja2.Environment:
    """Where the templates are read, each of them once."""
    folder = codegen_folder() / "templates"
    environment = templates(folder, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True)
    environment.globals |= {"abi": ABI, "hertz": hertz}
    environment.filters |= {
        "c_comment": c_comment,
        "c_format": c_format,
        "kconfig": kconfig,
        "markdown": markdown,
        "markdown_code": markdown_code,
        "one_line": one_line,
    }
    return environment


def hertz(rate: float | None, real: Real | None = None) -> str:
    """A sample rate as text; with `real` as a constant of C, an unsigned integer where it is a whole number, 0U for None."""
    value = rate or 0.0
    if abs(value - round(value)) <= 1e-9 * value:  # 1 / (1 / rate) is off by a rounding
        return f"{round(value)}" + ("U" if real else "")
    return real.literal(value) if real else f"{value:.17g}"


def write(template: str, context: dict[str, Any], path: Path) -> Path:
    """`render`, written to `path`, which is returned."""
    write_text(path, render(template, context))
    return path
