"""What the generated C and the writer of constants.bin must agree on (`ctrlgen.calibration.constants_files` states the layout)."""

from __future__ import annotations

MAGIC = b"CGRT"
VERSION = 1
CRC_POLYNOMIAL = 0xEDB88320  # of CRC-32, IEEE 802.3, reflected
OVERHEAD = 16  # bytes beside the numbers
