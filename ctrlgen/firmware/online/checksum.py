"""The checksum over a controller's state, which its C computes where a scenario asks for it (`checksum = true`).

It is a file of its own around the online controller (codegen/templates/checked.c.j2), which it does not change: words of the state in,
CRC-32 of IEEE 802.3 out, as of zlib.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

POLYNOMIAL = 0xEDB88320  # of IEEE 802.3, its bits in reverse order
# Instructions of a Cortex-M4F for a word of the state, in one of the two passes of a call: counted in tests/test_checksum.py, gcc -O2
WORD_INSTRUCTIONS = 18


def crc_table() -> tuple[int, ...]:
    """What each byte does to the checksum: T[b], with crc' = T[(crc ^ b) mod 256] ^ (crc / 256)."""
    table = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc >> 1) ^ (POLYNOMIAL if crc & 1 else 0)
        table.append(crc)
    return tuple(table)


def checked_context(online: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The context of checked.c.j2 and checked.h.j2: that of the `online` controller; `name` of the functions."""
    numbers = [f"0x{number:08X}U" for number in crc_table()]
    rows = [", ".join(numbers[k : k + 8]) + ("," if k + 8 < len(numbers) else "") for k in range(0, len(numbers), 8)]
    return {**online, "online": online["prefix"], "prefix": name, "crc_rows": rows}


def checksum_instructions(state_bytes: int) -> int:
    """What a call takes more on a Cortex-M4F for a state of so many bytes, about: a pass before it and one behind."""
    return 2 * WORD_INSTRUCTIONS * (state_bytes // 4)
