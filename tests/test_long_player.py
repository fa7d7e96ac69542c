"""Paths of so many samples and segments that their product is no word of 32 bits, in which the player's C finds a sample's segment."""

from __future__ import annotations

import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen import build_model, load_scenario, solve
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import render
from ctrlgen.firmware.c.toolchains import FLAGS
from ctrlgen.firmware.online.online import online_context
from ctrlgen.firmware.player import spline
from ctrlgen.firmware.player.compression import Compression, PlayerCandidate
from ctrlgen.firmware.player.player_context import player_context

pytestmark = pytest.mark.long

SAMPLES, PERIODS, TOLERANCE = 120_000, 2_700, 1e-5
WORD = 2**32


def waves(samples, periods):
    """(samples, 1): a drive within 0.2 ... 0.8 that swings slowly faster and slower, and goes on into itself."""
    angle = 2 * np.pi * np.arange(samples) / samples
    return 0.5 + 0.3 * np.sin(periods * angle + 5 * np.sin(angle))[:, None]


@pytest.fixture(scope="module")
def drive():
    return waves(SAMPLES, PERIODS)


@pytest.fixture(scope="module")
def curves(drive):
    return {
        closed: spline.fit(drive, np.zeros(1), np.ones(1), np.full(1, TOLERANCE), closed) for closed in (True, False)
    }


@pytest.mark.parametrize("closed", [True, False])
def test_no_piece_has_more_places_than_a_word_counts(drive, curves, closed):
    """And all of them are on the drive, a few rows more than one piece would take."""
    curve = curves[closed]
    assert sum(p.segments for p in curve.pieces) * SAMPLES > WORD
    assert all((p.stop - p.start) * p.segments <= WORD for p in curve.pieces)
    assert [p.stop for p in curve.pieces] == [*(p.start for p in curve.pieces[1:]), SAMPLES]
    assert np.abs(curve.values(Real.DOUBLE) - drive).max() <= 1.01 * TOLERANCE


@pytest.mark.parametrize("samples, periods", [(1, 0), (2, 1), (12, 1), (1_000, 3), (5_000, 40)])
def test_a_path_of_few_samples_is_not_cut(samples, periods):
    bounds = np.zeros(1), np.ones(1), np.full(1, 1e-4)
    for closed in (True, False):
        curve = spline.fit(waves(samples, periods), *bounds, closed)
        assert curve is None or len(curve.pieces) == 1


MAIN = """
#include "{p}.h"
#include <stdio.h>
#include <stdlib.h>
int main(int count, char **words)
{{
    int k;
    for (k = 1; k < count; k++) {{
        {real} u[2];
        const uint32_t index = (uint32_t)strtoul(words[k], NULL, 10);
        unsigned status = {p}_sample(index, &u[0]);
        status |= {p}_at(({real})(((double)index + 0.75) / {rate}), &u[1]);
        (void)printf("%u %.17g %.17g\\n", status, (double)u[0], (double)u[1]);
    }}
    return 0;
}}
"""


@pytest.mark.parametrize("real", list(Real))
def test_the_c_plays_every_part_of_such_a_path(drive, curves, compiler, real, tmp_path):
    scenario = load_scenario(SCENARIOS / "flexure_axis_line")
    short = solve(scenario, build_model(scenario.device))
    chosen = PlayerCandidate(
        kind="cubic",
        size="",
        bytes=0,
        operations=0,
        instructions=0,
        length=0.0,
        angle=0.0,
        drive=0.0,
        chosen=True,
        remark="",
    )
    endless = np.full(1, np.inf)
    compression = Compression(real, curves[False], False, -endless, endless, (chosen,))
    controller = controller_of(short.model, scenario.file.follow, scenario.sample_time)
    context = online_context(scenario, controller, real, "wave") | player_context(
        replace(short, drive=drive), compression, "wave"
    )
    for end in "ch":
        (tmp_path / f"wave.{end}").write_text(render(f"player.{end}", context))
    # that much is told, as a share of a sample, where it is not little
    said = re.search(r"A float rounds the time: .* (\S+) of a sample", (tmp_path / "wave.h").read_text())
    assert (said is None) == (real is Real.DOUBLE) and (
        said is None or 0.01 < float(said[1]) <= 2 * real.epsilon * 1.05 * SAMPLES
    )
    (tmp_path / "main.c").write_text(MAIN.format(p="wave", real=real.value, rate=context["rate"]))
    program = tmp_path / "wave"
    words = [compiler, *FLAGS, f"-I{tmp_path}", tmp_path / "main.c", tmp_path / "wave.c", "-o", program]
    subprocess.run(list(map(str, words)), check=True)
    k = np.unique(np.linspace(0, SAMPLES - 2, 2_000).astype(int))
    told = subprocess.run([str(program), *map(str, k)], capture_output=True, text=True, check=True)
    rows = np.array([line.split() for line in told.stdout.splitlines()], dtype=float)
    assert not rows[:, 0].any()
    assert np.abs(rows[:, 1] - compression.drives(k)[:, 0]).max() < 8 * real.epsilon
    # the time, its product and the sample's place are rounded: so much of the steepest change from sample to sample
    steep = 2 * real.epsilon * SAMPLES * np.abs(np.diff(drive, axis=0)).max()
    assert np.abs(rows[:, 2] - compression.drives(k, np.full(len(k), 0.25))[:, 0]).max() < 8 * real.epsilon + steep
