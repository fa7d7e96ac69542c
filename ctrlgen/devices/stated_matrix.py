"""Compliances and stiffnesses that a file states as a matrix, measured or from finite elements: what makes one impossible.

By reciprocity (Maxwell and Betti) deflections per load C, in conjugate directions, are symmetric, and no load gains energy from a
passive structure, so that C is positive definite; likewise loads per deflection. What a file prints is rounded or measured: the
symmetric part (C + C')/2 is taken, the nearest symmetric matrix (N. J. Higham, Linear Algebra Appl. 103 (1988) 103). Entries of
different units are compared in units of sqrt(C_ii C_jj).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

MOST_ASYMMETRY = 0.01  # two numbers of three printed digits, such as those of a paper, may differ by so much
DEVIATIONS = (
    3.0  # standard deviations of the difference, where the file states them, by which two entries may differ too
)
ROUNDING = 1e-9  # of symmetry, and of the smallest eigenvalue of a matrix with a diagonal of ones
TAKES_PART = 0.3  # of the largest component of the direction that gains energy: rows that are named


def scaled(C: np.ndarray) -> np.ndarray:
    """C_ij/sqrt(C_ii C_jj) (n, n)."""
    size = np.sqrt(np.diag(C))
    return C / np.outer(size, size)


def asymmetry(C: np.ndarray) -> float:
    """How far C (n, n) is from reciprocity, the largest |C_ij - C_ji|/sqrt(C_ii C_jj)."""
    return float(np.abs(scaled(C) - scaled(C).T).max())


def symmetric_note(key: str, C: np.ndarray) -> list[str]:
    """That the matrix `key` was made symmetric, if it was not."""
    if asymmetry(C) <= ROUNDING:
        return []
    return [f"{key} is not symmetric by {100 * asymmetry(C):.2g} %: the mean of both halves is taken"]


def matrix_faults(key: str, C: np.ndarray, rows: Sequence[str], sd: np.ndarray | None = None) -> list[str]:
    """What makes C (n, n) no compliance or stiffness, by its `rows`; entries may differ across the diagonal by `MOST_ASYMMETRY`, or by
    what their standard deviations `sd` (n, n), zero where none is stated, make likely."""
    if wrong := [row for row, c in zip(rows, np.diag(C), strict=True) if not c > 0]:
        return [
            f"{key}: not positive definite: on the diagonal {', '.join(wrong)} must be above zero; check signs, and the order of columns"
        ]
    faults, relative = [], scaled(C)
    noise = np.zeros_like(C) if sd is None else sd / np.sqrt(np.outer(np.diag(C), np.diag(C)))
    for i, row in enumerate(rows):
        for j in range(i):
            apart = abs(relative[i, j] - relative[j, i])
            if apart > max(MOST_ASYMMETRY, DEVIATIONS * np.hypot(noise[i, j], noise[j, i])):
                faults.append(
                    f"{key}: rows {rows[j]} and {row}: what stands across the diagonal differs by {100 * apart:.2g} %, and by reciprocity "
                    "is equal; check both entries, and the order of rows and columns"
                )
    if faults:
        return faults
    relative = (relative + relative.T) / 2
    values, directions = np.linalg.eigh(relative)
    if values[0] <= ROUNDING:
        parts = np.abs(directions[:, 0])
        named = [row for row, part in zip(rows, parts, strict=True) if part >= TAKES_PART * parts.max()]
        return [
            f"{key}: not positive definite: a load along {', '.join(named)} together would gain energy from it; check what couples "
            "these rows"
        ]
    return []
