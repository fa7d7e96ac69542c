"""The text of a measurement file, whatever encoding a logger wrote it in."""

from __future__ import annotations

import codecs
import re
from pathlib import Path

from ctrlgen.core.counts import number_of
from ctrlgen.recordings.formats.checked_files import fault, read_bytes
from ctrlgen.recordings.formats.layout_question import Ambiguous, AmbiguousFile

BOMS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32"),
        (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))  # fmt: skip
TRIED = [
    "cp1252",
    "cp437",
    "cp850",
    "mac_roman",
    "cp1250",
    "cp1251",
    "shift_jis",
    "euc_jp",
    "gb18030",
    "big5",
    "euc_kr",
]
"""Encodings that programs of loggers write beside those of Unicode; digits are the same in all of them."""
WESTERN = frozenset("µ°²³±äöüßéèà·ÄÖÜ".encode("cp1252"))
"""Bytes of signs that units and German names are written with in cp1252, the encoding of Windows in Europe and America."""
MSDOS = frozenset("µ°²±äöüßéèàÄÖÜ".encode("cp437"))
"""The same in the encoding of MS-DOS, which some instruments keep: one byte of µ before a letter would be a Chinese sign."""
COLOURS = re.compile(r"\x1b\[[\d;]*m")
"""What colours lines on a terminal."""
SAMPLE = 200_000  # bytes at the head of a file, by which an encoding is known


def decoded(path: Path, encoding: str | None = None) -> tuple[str, list[str]]:
    """The text of a file with lines ended by one mark, and notes of what was interpreted.

    Raises InputError where it is no text, or not in the stated encoding.
    """
    return decoded_bytes(path, read_bytes(path), encoding)


def decoded_bytes(path: Path, content: bytes, encoding: str | None = None) -> tuple[str, list[str]]:
    """The same of the `content` of a file, or of parts of it."""
    stated = encoding or next((name for mark, name in BOMS if content.startswith(mark)), None) or _wide(content)
    notes = [f"encoding {stated}"] if stated not in (None, encoding, "utf-8-sig") else []
    if stated is None:
        try:
            text = content.decode("utf-8")
        except UnicodeDecodeError as error:
            stated = _eight_bits(content, error.start)
            text = content.decode(stated, errors="replace")
            notes = [f"not UTF-8: read as {stated}"]
    else:
        try:
            text = content.decode(stated)
        except (UnicodeDecodeError, LookupError) as error:
            what = f"cannot be read as {stated} ({error})"
            raise AmbiguousFile(path, Ambiguous(what, {'encoding = "cp1252"': "(for one) with its encoding"})) from None
    text = COLOURS.sub("", text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n"))
    lost = len(text) - len(text.rstrip("\0"))
    if lost and lost < len(text):  # a logger that lost its power
        text = text.rstrip("\0")
        notes = [
            *notes,
            f"{number_of(lost, 'null character at the end is', 'null characters at the end are')} left out",
        ]
    if "\0" in text:
        before, *_, behind = parts = text.split("\0")
        plain = all(c.isprintable() or c in "\n\t" for c in before + behind)
        if plain and not any(parts[1:-1]):
            line = before.count("\n") + 1
            what = f"holds {len(parts) - 1} null characters in line {line}, as a logger writes that lost its power: rows may be lost there"
            raise fault(path, f"{what}; delete that line and write a record for the rows before and after it")
        raise fault(
            path, "is no text, although its ending or its beginning says so; export it again, or give it its own ending"
        )
    return text, notes


def _wide(content: bytes) -> str | None:
    """UTF-16 without its mark: every second byte of plain text is zero."""
    head = content[:SAMPLE]
    even, odd = head[::2].count(0), head[1::2].count(0)
    if len(head) < 8 or max(even, odd) < 0.4 * len(head) / 2 or min(even, odd) > 0.01 * len(head):
        return None
    return "utf-16-le" if odd > even else "utf-16-be"


def _eight_bits(content: bytes, first: int) -> str:
    """The encoding of text that is not UTF-8 from byte `first` on; only names and units depend on it."""
    sample = content[max(0, first - SAMPLE // 2) : first + SAMPLE // 2]
    if all(byte < 128 or byte in WESTERN for byte in set(sample)):
        return "cp1252"
    if all(byte < 128 or byte in MSDOS for byte in set(sample)):
        return "cp437"
    from charset_normalizer import from_bytes  # takes a moment to import

    best = from_bytes(sample, cp_isolation=TRIED).best()
    return best.encoding if best else "cp1252"
