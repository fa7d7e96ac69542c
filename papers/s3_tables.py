"""The printed numbers of S3 Tables 1, 4, 5 and 6, digit by digit, without thousands separators."""

from __future__ import annotations

CASES = (1, 2)
SYMBOLS = ("C_oFo", "C_oFin", "C_inFin", "J")

# Row by row. C_oFo in um/N, urad/N, um/(N m), urad/(N m); C_oFin in um/N and urad/N; C_inFin in um/N; J has no printed
# unit. Rows 1 and 2 are displacements, row 3 is the rotation.
UNITS = {
    "C_oFo": ("um/N um/N um/(N*m)", "um/N um/N um/(N*m)", "urad/N urad/N urad/(N*m)"),
    "C_oFin": ("um/N um/N um/N", "um/N um/N um/N", "urad/N urad/N urad/N"),
    "C_inFin": ("um/N um/N um/N", "um/N um/N um/N", "um/N um/N um/N"),
    "J": ("um/um um/um um/um", "um/um um/um um/um", "urad/um urad/um urad/um"),
}

TABLE_4 = {
    1: {
        "C_oFo": ("10.486 0 0", "0 10.486 0", "0 0 24747"),
        "C_oFin": ("0.810 0.229 -1.039", "0.732 -1.068 0.335", "-30.924 -30.924 -30.924"),
        "C_inFin": ("0.152 -0.018 -0.018", "-0.018 0.152 -0.018", "-0.018 -0.018 0.152"),
        "J": ("4.749 1.345 -6.093", "4.294 -6.260 1.965", "-266.749 -266.749 -266.749"),
    },
    2: {
        "C_oFo": ("12.215 0 0", "0 12.215 0", "0 0 27335"),
        "C_oFin": ("0.943 0.267 -1.211", "0.853 -1.244 0.390", "34.159 -34.159 -34.159"),
        "C_inFin": ("0.175 -0.024 -0.024", "-0.024 0.175 -0.024", "-0.024 -0.024 0.175"),
        "J": ("4.749 1.345 -6.093", "4.294 -6.260 1.965", "-266.743 -266.743 -266.743"),
    },
}

# Finite elements
TABLE_5 = {
    "C_oFo": ("11.498 0 0", "0 11.476 0", "0 0 27966"),
    "C_oFin": ("0.879 0.257 -1.136", "0.803 -1.162 0.357", "-32.141 -32.245 -32.115"),
    "C_inFin": ("0.182 -0.024 -0.024", "-0.024 0.182 -0.024", "-0.024 -0.024 0.182"),
    "J": ("4.259 1.250 -5.499", "3.897 -5.645 1.734", "-240.768 -241.315 -240.481"),
}

# Per cent of the finite elements; . where the print has a dash
TABLE_6 = {
    1: {
        "C_oFo": ("-8.8 . .", ". -8.6 .", ". . -11.5"),
        "C_oFin": ("-7.9 10.9 -8.5", "-8.8 8.1 -6.0", "-3.8 4.1 -3.7"),
        "C_inFin": ("-16.3 -25.5 -25.5", "-25.5 -16.3 -25.5", "-25.5 -25.5 -16.3"),
        "J": ("11.5 7.6 10.8", "10.2 10.9 13.3", "10.8 10.5 10.9"),
    },
    2: {
        "C_oFo": ("6.2 . .", ". 6.4 .", ". . -2.3"),
        "C_oFin": ("7.3 3.8 6.6", "6.3 7.1 9.5", "6.3 5.9 6.4"),
        "C_inFin": ("-3.8 -3.7 -3.7", "-3.7 -3.8 -3.7", "-3.7 -3.7 -3.8"),
        "J": ("11.5 7.6 10.8", "10.2 10.9 13.3", "10.8 10.5 10.9"),
    },
}

# Entries printed without their minus sign: (case, symbol, row, column), counted from 1.
SIGN_LOST_4 = {(2, "C_oFin", 3, 1)}
SIGN_LOST_6 = {(1, "C_oFin", 1, 2), (1, "C_oFin", 2, 2), (1, "C_oFin", 3, 2)}

RATIOS = {1: "0.764", 2: "0.374", 3: "0.167"}  # Table 1, t/R of hinges 1, 2, 3


def entries(table: dict[str, tuple[str, str, str]]) -> list[tuple[str, int, int, str]]:
    """(symbol, row, column, text) of every printed entry, rows and columns counted from 1."""
    return [
        (symbol, i, j, text)
        for symbol in SYMBOLS
        for i, line in enumerate(table[symbol], start=1)
        for j, text in enumerate(line.split(), start=1)
        if text != "."
    ]


def unit(symbol: str, i: int, j: int) -> str:
    """Unit of entry (i, j), counted from 1."""
    return UNITS[symbol][i - 1].split()[j - 1]
