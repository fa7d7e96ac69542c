"""Mode shapes as lines and as drawings."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from ctrlgen import load_device
from ctrlgen.devices.mechanism.mode_shapes import bent
from ctrlgen.reporting.mode_drawing import mode_svg

DEVICES = Path(__file__).parent.parent / "scenarios" / "devices"


def test_the_first_mode_of_a_parallelogram_bends_its_blades_with_clamped_ends():
    shapes = load_device(DEVICES / "parallelogram.toml").mode_shapes()
    assert len(shapes) == 6
    blades = [line for line in shapes[0].lines if line.of == "flexure"]
    stage = [line for line in shapes[0].lines if line.of == "body"]
    for blade in blades:
        s = (blade.rest - blade.rest[0]) @ (blade.rest[-1] - blade.rest[0])
        s = s / s[-1]
        # the cubic of a guided beam; the stage turns a little, which its ends follow: below 1e-3
        assert blade.moved[:, 0] / blade.moved[-1, 0] == pytest.approx(3 * s**2 - 2 * s**3, abs=1e-3)
        assert np.abs(blade.moved[0]).max() == 0
    moves = np.vstack([line.moved for line in stage])
    assert np.abs(moves[:, 1:]).max() < 1e-2 * np.abs(moves[:, 0]).min()


def test_a_flexure_whose_ends_move_as_one_is_only_turned():
    """About the origin, by w x p + v; rounding of numbers of one size."""
    start, end, w, v = np.random.default_rng(4).normal(size=(4, 3))
    line = bent(start, end, twist := np.concatenate([w, v]), twist)
    assert np.allclose(line.rest[[0, -1]], [start, end], rtol=0, atol=1e-15)
    assert np.allclose(line.moved, np.cross(w, line.rest) + v, rtol=0, atol=1e-14)


def test_modes_are_drawn_up_to_the_frequency_that_is_told():
    shapes = load_device(DEVICES / "tripod.toml").mode_shapes()
    frequencies = [shape.frequency for shape in shapes]
    assert frequencies == sorted(frequencies)
    assert frequencies[-1] <= 5 * 60  # five times the fastest condensed mode
    text = mode_svg(shapes[0])
    assert text.count("<animate ") == len(shapes[0].lines)
    assert "script" not in text
    numbers = [float(x) for part in re.findall(r'points="([^"]*)"', text) for x in re.split("[ ,]", part)]
    assert min(numbers) >= 0 and max(numbers) <= 300
