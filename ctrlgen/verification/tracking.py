"""Where the model goes under the drives that the C computed: what is followed, minus its command."""

from __future__ import annotations

import tempfile
from enum import StrEnum
from pathlib import Path

import numpy as np

from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder
from ctrlgen.model.simulation import trace
from ctrlgen.trajectory.unstated_modes import followed_under
from ctrlgen.verification.host import Host
from ctrlgen.verification.reference import ReferenceAnswers


class Piece(StrEnum):
    """What of the generated C computes drives."""

    ONLINE = "online C"
    PLAYER = "player C"


def reached(ref: ReferenceAnswers, followed: np.ndarray) -> np.ndarray:
    """(n, channels) of the followed signal [SI]: the model under the drives of the C's answers `followed`.

    Where the scenario has no sample time, the model at the displacements and states of these answers.
    """
    drives = followed[:, ref.columns["drive"]]
    if ref.scenario.sample_time is not None:
        return reached_under(ref, drives)
    m, rest = ref.model, ref.solution.trace.x[:, ref.model.n_states :]
    x = np.hstack([followed[:, ref.columns["displacement"].stop :], rest])
    at = trace(m, np.zeros(len(x)), x, followed[:, ref.columns["displacement"]], drives)
    return at.signals[ref.scenario.file.follow]


def reached_under(ref: ReferenceAnswers, drives: np.ndarray) -> np.ndarray:
    """(n, channels) of the followed signal [SI]: the model simulated under `drives` (samples, axes) from the first sample solved."""
    return followed_under(ref.scenario, ref.model, drives, *ref.start[:2])


def tracking_errors(folder: CFolder, ref: ReferenceAnswers) -> dict[Piece, dict[Real, np.ndarray]]:
    """Online C and player C -> arithmetic -> (n, channels), SI: the model under their drives minus the command.

    Raises ToolError where the C is refused.
    """
    errors: dict[Piece, dict[Real, np.ndarray]] = {Piece.ONLINE: {}}
    with tempfile.TemporaryDirectory(prefix="ctrlgen-") as name:
        for real in Real:
            host = Host(folder, ref, real, Path(name))
            moving = ref.scenario.sample_time is not None
            followed = host.followed(ref.command, ref.start) if moving else host.settled(ref.command)
            errors[Piece.ONLINE][real] = reached(ref, followed) - ref.path
            if folder.player:
                played = host.played(np.arange(len(ref.solution.drive)))[:, 1:]
                errors.setdefault(Piece.PLAYER, {})[real] = reached_under(ref, played) - ref.path
    return errors
