"""Constant loads of mechanisms: sag, load stiffness and stress against closed forms; faults; their C."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from held_blades import EI, E, L, T, W, frame_of
from mechanism_files import HEAD, PARALLELOGRAM, REST, blade, dm, loaded, with_values

from ctrlgen import InputError, build_model, run
from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.load_effects import load_lines
from ctrlgen.devices.mechanism.loads import without_rounding
from ctrlgen.devices.mechanism.mechanism_lines import summary
from ctrlgen.devices.mechanism.modes import guyan_modes

K, G = 24 * EI / L**3, 9.81  # of the parallelogram of two blades
HEAVY = PARALLELOGRAM.replace(
    'name = "stage"\n', 'name = "stage"\nmass = "80 g"\ninertia = ["9 kg*mm^2", "9 kg*mm^2", "9 kg*mm^2"]\n'
)


def falling(x: float, y: float, text: str = HEAVY) -> str:
    """The device with gravity along x and y."""
    return text.replace("[[material]]", f'gravity = ["{x} m/s^2", "{y} m/s^2", "0 m/s^2"]\n[[material]]', 1)


def load(what: str, at: str = '["0 mm", "0 mm", "0 mm"]', on: str = "stage") -> str:
    return f'[[load]]\nname = "on_it"\non = "{on}"\nat = {at}\n{what}\n'


def law(device) -> tuple[float, float]:
    """Force at home and slope of the force that pulls the axis home."""
    d = ca.SX.sym("d", 1)
    force = ca.Function("force", [d], [device.physics(device.values()).restoring_force(d)])
    return float(force(0.0)), (float(force(1e-5)) - float(force(-1e-5))) / 2e-5


def test_a_stage_sags_by_its_weight_its_payload_and_half_of_its_blades(tmp_path):
    """(m + m_p + rho V/2 of both) g/K across; the stress at the blades' ends is 3 E t y/l^2 of that with the drives at zero."""
    dense = HEAVY.replace('poisson = "0.28"', 'poisson = "0.28"\ndensity = "2329 kg/m^3"')
    device = loaded(tmp_path, falling(G, 0, dense) + load('mass = "30 g"'))
    force, slope = law(device)
    weight = (0.11 + 2329 * L * T * W) * G
    assert force == pytest.approx(-weight, rel=1e-6) and slope == pytest.approx(K, rel=1e-6)
    model = build_model(device)
    stress = ca.Function("stress", [model.z], [next(x.expr for x in model.limits if x.name.startswith("stress_"))])
    sag = weight / K
    assert stress(sag).full().max() == pytest.approx(3 * E * T * sag / L**2, rel=0.01)
    c = Condensed(*with_values(device))
    assert dm(c.mass)[0, 0] == pytest.approx(0.11 + 2 * 13 / 35 * 2329 * L * T * W, rel=1e-3)
    assert f"delta_x {1.0001e6 * sag:.4g} um" in load_lines(device)[0]  # and the blades' stretching turns it


@pytest.mark.parametrize("P", [-3.0, 3.0])
def test_a_load_along_the_blades_softens_or_stiffens_a_parallelogram(tmp_path, P):
    """12 EI/l^3 - 6 P/(5 l), of both blades that share P: as a force, and as the weight of a mass that hangs or stands."""
    hung = falling(0, -P / 0.08)
    for text in (PARALLELOGRAM + load(f'force = ["0 N", "{-P} N", "0 N"]'), hung):
        _, slope = law(loaded(tmp_path, text))
        assert slope == pytest.approx(K - 6 * P / (5 * L), rel=1e-4)


def test_check_prints_the_modes_under_the_loads(tmp_path):
    """sqrt((K - 6 P/(5 l))/m)/(2 pi) under a force P that presses the blades."""
    device = loaded(tmp_path, HEAVY + load('force = ["0 N", "-3 N", "0 N"]'))
    pressed = guyan_modes(device, under_loads=True).frequencies
    assert pressed == pytest.approx(np.sqrt((K - 6 * 3 / (5 * L)) / 0.08) / (2 * np.pi), rel=1e-4)
    assert f"the same under the constant loads: {show(float(pressed[0]), 'Hz')}" in summary(device)
    assert pressed < 0.99 * guyan_modes(device).frequencies


@pytest.mark.parametrize(
    "force, at, along, pushed",
    [
        ((0.03, 0.0), (-10e-3, 5e-3), ("[0, 1, 0]",), (0, 0)),
        ((0.0, -0.05), (4e-3, 0.0), ("[0, 1, 0]",), (0, 0)),
        ((0.02, -0.05), (4e-3, 8e-3), ("[0.2, 1, 0]",), (15, 5)),
        ((0.3, -0.5), (4e-3, 6e-3), ("[0.2, 1, 0]", "[-0.4, 1, 0]"), (0, -10)),
    ],
)
def test_the_stiffness_of_a_load_is_that_of_corotational_beams(tmp_path, force, at, along, pushed):
    """Half the difference of the slopes under a load and its opposite, which is of first order in it: on a single blade, which the load
    turns while the axis is held, and on leaning blades that are not alike."""
    text = PARALLELOGRAM.replace('at = ["0 mm", "-10 mm"', f'at = ["{pushed[0]} mm", "{pushed[1]} mm"')
    for k, (name, x) in enumerate((("left", -10), ("right", 10))):
        turned = blade(name, x).replace("[0, 1, 0]", along[k]) if k < len(along) else ""
        text = text.replace(blade(name, x), turned)
    place = f'["{at[0]} m", "{at[1]} m", "0 m"]'
    slopes = [
        law(loaded(tmp_path, text + load(f'force = ["{s * force[0]} N", "{s * force[1]} N", "0 N"]', place)))[1]
        for s in (1, -1)
    ]
    frame, (push, on) = frame_of(Condensed(*with_values(loaded(tmp_path, text))), 1e-3 * np.array(pushed), at)
    q = np.zeros(3 * len(frame.X))
    q[on : on + 2] = force
    exact = frame.stiffness(push, q) - frame.stiffness(push, -q)
    assert slopes[0] - slopes[1] == pytest.approx(exact, rel=5e-3)  # of beams a twenty-fourth of a blade long


def test_a_weight_on_a_pivot_tips_it(tmp_path):
    """-m g h of a mass at the height h over a pivot, seen at an arm r; a force between two bodies turns with neither."""
    pivot = "".join(f'theta_{x}_per_M_{x} = "{1 if x == "z" else 1e-6} rad/(N*m)"\n' for x in "xyz")
    pivot += "".join(f'delta_{x}_per_F_{x} = "1e-6 um/N"\n' for x in "xyz")
    rest = REST.replace(
        'at = ["0 mm", "0 mm", "0 mm"]\nalong = [1, 0, 0]', 'at = ["10 mm", "0 mm", "0 mm"]\nalong = [0, 1, 0]'
    )
    text = (
        HEAD
        + '[[body]]\nname = "plate"\n[[element]]\nkind = "compliance"\nname = "pivot"\nfrom = "ground"\nto = "plate"\n'
    )
    text += 'at = ["0 mm", "0 mm", "0 mm"]\n' + pivot + rest.replace("delta_x", "theta_z")
    text += load('force = ["0 N", "-5 N", "0 N"]', '["0 mm", "40 mm", "0 mm"]', "plate")
    _, slope = law(loaded(tmp_path, text))
    assert slope == pytest.approx((1 - 5 * 0.04) / 0.01**2, rel=1e-5)


def test_loads_that_cannot_be_held_are_refused(tmp_path):
    for text, fault in (
        (load('force = ["0 N", "-40 N", "0 N"]'), "the loads buckle the mechanism"),
        (load('mass = "1 g"'), "give mass and inertia to the body that carries it"),
        (load('mass = "1 g"', on="stge"), "'stge' is no body"),
        (load('mass = "1 g"\nforce = ["0 N", "0 N", "1 N"]'), "give either force or mass"),
    ):
        with pytest.raises(InputError) as caught:
            loaded(tmp_path, PARALLELOGRAM + text)
        assert fault in str(caught.value)


@pytest.mark.long
def test_a_loaded_stage_is_solved_and_its_c_is_the_model(tmp_path):
    """Across gravity and pressed, with inertia and without: the drive at rest holds the weight, and the C passes."""
    text = falling(3, -9)
    for more in ("", '[dynamics]\ndamping_ratio = "2 %"\n'):
        (tmp_path / "device.toml").write_text(text + load('force = ["0 N", "-1 N", "0 N"]') + more)
        (tmp_path / "scenario.toml").write_text(
            'title = "t"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "200 ms"\n'
            '[path]\nkind = "line"\nstart = { delta_x = "-50 um" }\nend = { delta_x = "100 um" }\n'
        )
        outcome = run(tmp_path, tmp_path / f"out{bool(more)}")
        held = (K - 6 * 1.72 / (5 * L)) * np.array([-50e-6, 100e-6]) - 0.08 * 3
        assert outcome.passed
        assert outcome.solution.drive[[0, -1], 0] * 2 == pytest.approx(held, rel=2e-3)


def test_rounding_of_a_symmetric_drawing_is_left_out_of_what_loads_do():
    """3e-59 N/m beside a stiffness of 1e4 N/m is zero of a symmetric stage, and no number in single precision; symbols stay."""
    K = ca.DM([[-258.8, 3e-59], [3e-59, 2e-9]])
    kept = without_rounding(K, lambda: np.full((2, 2), 1e4))
    assert dm(kept).tolist() == [[-258.8, 0.0], [0.0, 0.0]] and kept.nnz() == 1
    x = ca.SX.sym("x", 2)
    assert without_rounding(x, lambda: np.full(2, 1e4)) is x
