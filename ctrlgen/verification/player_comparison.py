"""The player of the generated C against its curve, the solved drives, and, through the model, the command."""

from __future__ import annotations

import numpy as np

from ctrlgen.firmware.player.compression import Compression
from ctrlgen.trajectory.playback import ANGLE_TOLERANCE, length_tolerance
from ctrlgen.verification.compared_program import ComparedProgram
from ctrlgen.verification.comparison_entry import ComparisonEntry, ComparisonKind
from ctrlgen.verification.tolerances import ROUNDINGS
from ctrlgen.verification.tracking import reached_under


def player_rows(program: ComparedProgram, compression: Compression) -> list[ComparisonEntry]:
    """All comparisons of the player of one build."""
    ref, epsilon = program.reference, program.real.epsilon
    solved = ref.solution.drive
    k, n = np.arange(len(solved)), solved.shape[1]
    # against the curve evaluated by NumPy: its roundings, for a compiler that fuses a product and a sum
    near = ROUNDINGS * epsilon * np.abs(solved).max()
    played = program.run("sample", k, n)[:, 1:]
    times = (k[:-1] + 0.75) * ref.sample_time  # a quarter of the way from middle to middle
    quarter = program.run("at", times, n)[:, 1:] - compression.drives(k[:-1], np.full(len(k) - 1, 0.25))
    # the time itself is rounded: that much of the steepest change from sample to sample
    steep = 4 * epsilon * 2 * len(k) * np.abs(np.diff(solved, axis=0)).max()
    solver = ComparisonKind.PLAYED_ROOT if ref.model.inertial else ComparisonKind.PLAYED_OPTIMUM
    off = ref.once("played", played, lambda drives: reached_under(ref, drives)) - ref.played_path
    allowed = length_tolerance(ref.model.signals[ref.scenario.file.follow])
    return [
        *program.off_command(ComparisonKind.PLAYER_PATH, off, ANGLE_TOLERANCE, allowed),
        program.row(ComparisonKind.CURVE, "drive", played - compression.drives(k), near),
        program.row(solver, "drive", played - solved, (compression.chosen.drive or 0.0) + near),
        program.row(ComparisonKind.BETWEEN, "drive", quarter, near + steep),
    ]
