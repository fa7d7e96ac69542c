"""Where the model goes under the drives that the C computed: what is followed, minus its command."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder
from ctrlgen.model.simulation import simulate, trace
from ctrlgen.verification.host import Host
from ctrlgen.verification.reference import ReferenceAnswers


def reached(ref: ReferenceAnswers, drives: np.ndarray, followed: np.ndarray) -> np.ndarray:
    """(n, channels) of the followed signal, SI: the model simulated under `drives` (samples, axes) from IPOPT's first sample.

    Where the scenario has no sample time, the model at the displacements and states of `followed`, the C's answers.
    """
    m, role = ref.model, ref.scenario.file.follow
    first = ref.solution.trace
    if ref.scenario.sample_time is not None:
        return simulate(m, drives, ref.scenario.sample_time, first.x[0], first.z[0]).signals[role]
    n, n_u = len(m.axes), m.u.numel()
    z, state = followed[:, 1 + n_u : 1 + n_u + n], followed[:, 1 + n_u + n :]
    x = np.hstack([state, first.x[:, m.n_states :]])
    return trace(m, np.zeros(len(z)), x, z, drives).signals[role]


def tracking_errors(folder: CFolder, ref: ReferenceAnswers) -> dict[str, dict[Real, np.ndarray]]:
    """'online C' and 'player C' -> arithmetic -> (n, channels), SI: the model under their drives minus the command.

    Raises ToolError where the C is refused.
    """
    n_u = ref.model.u.numel()
    errors: dict[str, dict[Real, np.ndarray]] = {"online C": {}}
    with tempfile.TemporaryDirectory(prefix="ctrlgen-") as name:
        for real in Real:
            host = Host(folder, ref, real, Path(name))
            moving = ref.scenario.sample_time is not None
            followed = host.followed(ref.command, ref.start) if moving else host.settled(ref.command)
            errors["online C"][real] = reached(ref, followed[:, 1 : 1 + n_u], followed) - ref.path
            if folder.player:
                played = host.played(np.arange(len(ref.solution.drive)))[:, 1:]
                errors.setdefault("player C", {})[real] = reached(ref, played, followed) - ref.path
    return errors
