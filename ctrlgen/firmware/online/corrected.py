"""The corrections of a scenario as C: a library around the online controller, which it does not change (codegen/templates/corrected.c.j2).

A stored table is little-endian: 4 bytes "CGCT"; uint16 version of this layout; uint16 number n of values; uint32, what is corrected,
over what and how; n IEEE 754 floats, SI; uint32, the CRC-32 of all before (as of zlib). 16 + 4 n bytes, written by NAME_save and read by
NAME_load.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from collections.abc import Mapping
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.controller.correction import (
    EARLY,
    FAR,
    HALVINGS,
    HARMONIC_SHARE,
    MOST_SAMPLES,
    REFUSED,
    Basis,
    Correction,
    Corrections,
)
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import base_unit, same_dimension, show, written_unit
from ctrlgen.firmware.c.cprint import Kernel, Printer
from ctrlgen.firmware.c.elementary import elementary_text
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.online.checksum import POLYNOMIAL
from ctrlgen.firmware.online.constants_layout import OVERHEAD
from ctrlgen.trajectory.correction_section import CorrectionSection
from ctrlgen.trajectory.scenario import Scenario

MAGIC = b"CGCT"
VERSION = 1


def corrections_of(scenario: Scenario, kernels: ControllerKernels) -> Corrections | None:
    """What `[[correction]]` of the scenario states, for its controller; None where it has none. Raises InputError."""
    sections = scenario.file.correction
    if not sections:
        return None
    signal = kernels.model.signals[kernels.follow]
    order = len(kernels.target.channels) // len(signal.channels) - 1
    faults, each = list[Fault](), list[Correction]()
    for k, section in enumerate(sections):
        where = f"correction[{k}]"
        found = _faults(section, signal.channels, signal.units, where)
        if order and section.kind == "table":
            what = 'of a device with inertia takes derivatives, which straight lines have not; write kind = "harmonic"'
            found.append(Fault(f"{where}.kind", what))
        if any(section.of == other.of for other in sections[:k]):
            found.append(Fault(f"{where}.of", f"{section.of} is corrected twice; one correction a channel"))
        faults += found
        if not found:
            each.append(_bound(section, signal.channels))
    if faults:
        raise InputError(scenario.path, faults)
    return Corrections(tuple(each), len(signal.channels), order)


def _faults(section: CorrectionSection, channels: tuple[str, ...], units: tuple[str, ...], where: str) -> list[Fault]:
    """Names and units that the followed signal has not."""
    for key, name in (("of", section.of), ("over", section.along)):
        if name not in channels:
            return [Fault(f"{where}.{key}", f"{name!r} is no followed channel; known are {', '.join(channels)}")]
    unit_of, unit_over = (units[channels.index(name)] for name in (section.of, section.along))
    stated = [("bound", section.bound, unit_of), ("period", section.period, unit_over)]
    stated += [("range", end, unit_over) for end in section.range or ()]
    return [
        Fault(f"{where}.{key}", f'"{number.text}" must have the dimension of {unit}')
        for key, number, unit in stated
        if number is not None and not same_dimension(written_unit(number.text), unit)
    ]


def _bound(section: CorrectionSection, channels: tuple[str, ...]) -> Correction:
    """The correction of a section; its bound as float holds it, rounded down."""
    largest = np.float32(section.bound.si)
    if float(largest) > section.bound.si:
        largest = np.nextafter(largest, np.float32(0))
    if section.kind == "harmonic":
        assert section.period is not None and section.harmonics is not None
        basis = Basis("harmonic", 2 * section.harmonics, section.period.si)
    elif section.period is not None:
        assert section.entries is not None
        basis = Basis("table", section.entries, section.period.si)
    else:
        assert section.entries is not None and section.range is not None
        low, high = (end.si for end in section.range)
        basis = Basis("table", section.entries, high - low, low, closed=False)
    of, over = channels.index(section.of), channels.index(section.along)
    return Correction(of, over, basis, float(largest), section.gain)


def mark_of(scenario: Scenario, corrections: Corrections) -> int:
    """What tells tables of these corrections from others: 32 bits, never four bytes alike, as memory set to one value is."""
    mark = int(hashlib.sha256(repr((scenario.controller_name, corrections)).encode()).hexdigest()[:8], 16)
    return mark ^ (len(set(mark.to_bytes(4, "big"))) == 1)


def stored(mark: int, values: np.ndarray) -> bytes:
    """The bytes of a stored table with these `values` [SI]."""
    body = MAGIC + struct.pack(f"<HHI{len(values)}f", VERSION, len(values), mark, *values)
    return body + struct.pack("<I", zlib.crc32(body))


def read_stored(mark: int, table: bytes) -> np.ndarray:
    """The values [SI] of a stored table, such as one that a firmware sent home. Raises ValueError where it is damaged, or of another
    controller."""
    count = (len(table) - OVERHEAD) // 4
    if len(table) < OVERHEAD or table[:4] != MAGIC or struct.unpack("<I", table[-4:])[0] != zlib.crc32(table[:-4]):
        raise ValueError("is no table of corrections, or damaged")
    if struct.unpack("<HHI", table[4:12]) != (VERSION, count, mark):
        raise ValueError("is a table of another controller")
    return np.array(struct.unpack(f"<{count}f", table[12:-4]))


def corrected_context(
    scenario: Scenario, corrections: Corrections, online: Mapping[str, Any], name: str, real: Real
) -> dict[str, Any]:
    """The context of corrected.c.j2 and corrected.h.j2: that of the `online` controller; `name` of the functions."""
    printer = Printer(real, {})
    kernels, terms, first, at = list[Kernel](), list[dict[str, Any]](), 0, 0
    channels, units = _followed(online, corrections)
    for k, c in enumerate(corrections.each):
        kernels += _printed(printer, c, k, corrections.order)
        count = c.basis.count
        unit = base_unit(units[c.of])
        along = f"{channels[c.over]} [{base_unit(units[c.over])}]"
        way = f"a period of {show(c.basis.length, base_unit(units[c.over]))}" if c.basis.closed else "a range"
        kind = f"{count} entries" if c.basis.kind == "table" else f"{c.basis.harmonics} harmonics"
        about = f"{channels[c.of]} [{unit}] over {along}: {kind} of {way}, at most {show(c.bound, unit)}"
        what = "entries" if c.basis.kind == "table" else "sines, then cosines,"
        terms.append(
            {
                "about": about,
                "what": f"{what} of {channels[c.of]} [{unit}]",
                "unit": unit,
                "basis": c.basis,
                "of": c.of,
                "over": c.over,
                "bound": c.bound,
                "gain": c.gain,
                "first": first,
                "last": first + count - 1,
                "at": at,
            }
        )
        first += count
        at += 2 * count if c.basis.kind == "table" else 3 * count
    harmonic = any(c.basis.kind == "harmonic" for c in corrections.each)
    called = frozenset[str]().union(*(kernel.calls for kernel in kernels)) | ({"square_root"} if harmonic else set())
    texts = [elementary_text(called, real), printer.constants, *(kernel.text for kernel in kernels)]
    return {
        **online,
        "online": online["prefix"],
        "prefix": name,
        "terms": terms,
        "harmonic": harmonic,
        "order": corrections.order,
        "channels": corrections.channels,
        "count": corrections.count,
        "sums": at,
        "fewest": corrections.fewest,
        "most": MOST_SAMPLES,
        "far": FAR,
        "early": EARLY,
        "refused": REFUSED,
        "most_answer": 2 / max(c.gain for c in corrections.each),
        "harmonic_share": HARMONIC_SHARE,
        "halvings": HALVINGS,
        "mark": mark_of(scenario, corrections),
        "magic": int.from_bytes(MAGIC, "little"),
        "layout": VERSION + (corrections.count << 16),
        "overhead": OVERHEAD,
        "polynomial": POLYNOMIAL,
        "blocks": [text.strip("\n") for text in texts if text],
    }


def _followed(online: Mapping[str, Any], corrections: Corrections) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Channels and units of the followed signal, without derivatives."""
    follow, n = online["follow"], corrections.channels
    return follow.channels[:n], follow.units[:n]


def _printed(printer: Printer, c: Correction, k: int, order: int) -> list[Kernel]:
    """The functions of a correction as C: the place in a table; or harmonics to add, and those to sum up."""
    over = ca.SX.sym("over")
    if c.basis.kind == "table":
        place = ca.Function("place", [over], [c.basis.place(over)], ["over"], ["result"])
        about = "Where a channel is, in entries of the table."
        return [printer.kernel(place, f"place_{k}", about, returned=True)]
    waves = ca.Function("waves", [over], [c.basis.waves(over, c.basis.count)], ["over"], ["result"])
    about = "Sines and then cosines of the phase"
    return [
        printer.kernel(c.moved(order), f"basis_{k}", about + (", and their derivatives by time." if order else ".")),
        printer.kernel(waves, f"waves_{k}", f"{about}, of twice as many harmonics."),
    ]
