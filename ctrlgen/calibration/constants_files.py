"""The constants of a specimen as files that a firmware takes: C initialiser, and binary with a check sum.

constants.bin, little-endian: 4 bytes "CGRT"; uint16 version of this layout; uint16 number n of constants; uint32, the first 32 bits of
the SHA-256 of the device's description; n IEEE 754 floats, SI, in the order of the C structure; uint32, the CRC-32 of all before
(IEEE 802.3, polynomial 0xEDB88320 reflected, as of zlib). 16 + 4 n bytes. The generated C reads it with NAME_load.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from pathlib import Path

import numpy as np

from ctrlgen.calibration.calibrate import CalibratedConstant, Calibration
from ctrlgen.core.escaping import c_comment
from ctrlgen.core.files import encoded, write_text
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.online.constants_layout import MAGIC, VERSION
from ctrlgen.version import program

HEADER, BINARY = "constants.h", "constants.bin"


def device_hash(calibration: Calibration) -> int:
    """The number that the generated header has as DEVICE_HASH."""
    text = "".join(read.text for read in calibration.inputs.values())
    return int(hashlib.sha256(encoded(text)).hexdigest()[:8], 16)


def c_header(calibration: Calibration) -> str:
    """constants.h: an initialiser of the constants in each arithmetic, refused beside the C of another device, whichever is read first, and
    beside the constants of another specimen, whose macros have the same names."""
    name, number = calibration.device.name, device_hash(calibration)
    upper, specimen = name.upper(), int.from_bytes(binary(calibration)[-4:], "little")
    lines = [
        f"/* Constants of one specimen of {c_comment(calibration.device.title)},",
        f" * from the recording {c_comment(calibration.recording.title)}.",
        f" * Made by {program()}; do not edit. In the firmware, behind the controller's header:",
        f" *   static const {name}_online_f32_constants specimen = {upper}_CONSTANTS_F32;",
        f" *   status = {name}_online_f32_init_with(&state, &specimen); */",
        f"#ifndef {upper}_CONSTANTS_H",
        f"#define {upper}_CONSTANTS_H",
        "",
        f"#define {upper}_CONSTANTS_DEVICE_HASH (0x{number:08x}U) /* compared by a controller's header that is read behind this */",
        f"#define {upper}_CONSTANTS_SPECIMEN (0x{specimen:08x}U) /* of these numbers */",
        "",
    ]
    for real in Real:
        macro = f"{upper}_ONLINE_{real.suffix.upper()}_DEVICE_HASH"
        lines += [
            f"#if defined({macro}) && ({macro} != 0x{number:08x}U)",
            '#error "these constants belong to another device file than the controller; calibrate again"',
            "#endif",
        ]
    for real in Real:
        lines += ["", f"#define {upper}_CONSTANTS_{real.suffix.upper()} {{ \\"]
        rows = [f"{real.literal(inside(row, real))}" for row in calibration.constants]
        for k, (row, literal) in enumerate(zip(calibration.constants, rows, strict=True)):
            c, end = row.constant, "" if k == len(rows) - 1 else ","
            told = f"{c.base_unit}, sd {row.sd:.3g}" if row.determined else f"{c.base_unit}, default: {row.remark}"
            lines.append(f"    {literal}{end} /* {c.name}: {c_comment(told)} */ \\")
        lines.append("}")
    other = [
        "#else",
        f"#if ({upper}_CONSTANTS_SPECIMEN != 0x{specimen:08x}U) /* the header that was read first is another one */",
        f'#error "constants of two specimens of {name} in one source: give each a source of its own, or load constants.bin"',
        "#endif",
        "#endif",
    ]
    return "\n".join([*lines, "", *other, ""])


def binary(calibration: Calibration) -> bytes:
    """The bytes of constants.bin: head, values as float32, CRC-32."""
    values = [inside(row, Real.FLOAT) for row in calibration.constants]
    body = MAGIC + struct.pack(f"<HHI{len(values)}f", VERSION, len(values), device_hash(calibration), *values)
    return body + struct.pack("<I", zlib.crc32(body))


def inside(row: CalibratedConstant, real: Real) -> float:
    """The value as the arithmetic holds it, not beyond a bound by the rounding."""
    kind = np.float32 if real is Real.FLOAT else np.float64
    low, value, high = (kind(v) for v in (row.constant.low, row.value, row.constant.high))
    low = np.nextafter(low, high) if float(low) < row.constant.low else low
    high = np.nextafter(high, low) if float(high) > row.constant.high else high
    return float(min(max(value, low), high))


def write_constants(out: Path, calibration: Calibration) -> None:
    """Writes constants.h and constants.bin into the folder `out`."""
    write_text(out / HEADER, c_header(calibration))
    (out / BINARY).write_bytes(binary(calibration))
