"""Parts of a mechanism by their stiffness and mass from a finite-element program: what is read, what is refused, what they do."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import tomlkit
from mechanism_files import dm, loaded
from random_mechanisms import RandomMechanism
from super_elements import FIRST, part_of, super_element, with_part, written

from ctrlgen import InputError, load_device
from ctrlgen.app.scenario_pipeline import compare_only, run
from ctrlgen.core.edited_toml import with_moved_files
from ctrlgen.core.matrix_file import LARGEST_FILE
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.constraints import freedoms
from ctrlgen.devices.mechanism.force_readings import inertial
from ctrlgen.devices.mechanism.mechanism_lines import summary
from ctrlgen.devices.mechanism.modes import as_displacements, body_matrices, free_modes, natural_frequencies
from ctrlgen.model.assembly import movable
from ctrlgen.physics.stated_part import counted, extent, rigid_mass, rigid_motions

DEVICES = Path(__file__).parent.parent / "scenarios" / "devices"
# Two programs that solve the same equations in another order: 1e-12 of K, lost by the condition of a blade, 1e4
SAME = 1e-8
# What the device tells of its linear motion. The blades as they are bent are not in a part's matrices, and no line tells of them
TOLD = ("stiffness at the output point:", "centre of", "natural", "inertia condensed", "delta", "theta")


def dense(name: str) -> str:
    """A shipped device whose flexures have a mass."""
    text = (DEVICES / f"{name}.toml").read_text()
    return text if "density" in text else re.sub(r"^young", 'density = "7800 kg/m^3"\nyoung', text, flags=re.M)


def told(device) -> list[str]:
    return [line for line in summary(device) if line.startswith(TOLD)]


def parallelogram(folder: Path) -> tuple[str, np.ndarray, np.ndarray, np.ndarray]:
    """The shipped one's file without its blades, and both of them as K and M (SI) at two places."""
    text = dense("parallelogram")
    device = loaded(folder, text)
    places = np.array([[0.004, -0.025, 0.001], [0.003, 0.01, -0.002]])
    K, M = part_of(device, [0, 1], [-1, 0], places)
    document = tomlkit.parse(text)
    del document["element"]
    return document.as_string(), K, M, places


def table(K, M, places, **more: str) -> str:
    rows = {"stiffness": repr(written(K).tolist()), "mass": repr(written(M).tolist())}
    ports = [("ground", places[0]), ("stage", places[1])]
    return super_element("part", ports, {}, **{**rows, **more})


def faults(folder: Path, text: str) -> str:
    with pytest.raises(InputError) as error:
        loaded(folder, text)
    return str(error.value)


@pytest.mark.long
def test_a_part_by_its_condensed_matrices_is_the_part(tmp_path):
    rng = np.random.default_rng(3)
    for name, taken in (
        ("parallelogram", "left right"),
        ("xy_lever_stage", "guide_left guide_right coupling_left push_x"),
    ):
        cell = (
            "" if name == "parallelogram" else '[[reading]]\nname = "cell"\nof = "coupling_right"\npattern = "side"\n'
        )
        device = loaded(tmp_path, text := dense(name) + cell)
        elements = [k for k, e in enumerate(device.placed_elements) if e.section.name in taken.split()]
        bodies = sorted(
            {b for k in elements for b in (device.placed_elements[k].first, device.placed_elements[k].second)}
        )
        places = device.size * rng.uniform(-1, 1, (len(bodies), 3))
        other = loaded(tmp_path, with_part(text, device, tmp_path, elements, bodies, places))
        assert told(other) == told(device)
        of_both = [Condensed(d, d.values()) for d in (device, other)]
        for of in ("held_stiffness", "jacobian", "mass", "output_compliance"):
            one, two = (dm(getattr(c, of)) for c in of_both)
            assert np.abs(one - two).max() < SAME * np.abs(one).max(), (name, of)
        one, two = (dm(inertial(c)) for c in of_both)
        assert np.abs(one - two).max(initial=0) <= SAME * np.abs(one).max(initial=0)
        scales = [np.outer(as_displacements(d), as_displacements(d)) for d in (device, other)]
        for k in range(2):  # stiffness and mass of all bodies
            one, two = (body_matrices(c)[k] / scale for c, scale in zip(of_both, scales, strict=True))
            assert np.abs(one - two).max() < SAME * np.abs(one).max(), name


def test_copies_of_a_part_are_turned_and_mirrored(tmp_path):
    text = (DEVICES / "tip_tilt_mirror.toml").read_text()
    mirrored = text.replace("times = 3", 'mirror = "x"').replace(
        '"theta_x", "theta_y", "delta_z"', '"theta_y", "delta_z"'
    )
    more = '[[body]]\nname = "fixed"\n[[element]]\nkind = "compliance"\nname = "skewed"\npattern = "leg"\nfrom = "ground"\nto = "mirror"\n'
    more += 'at = ["9 mm", "3 mm", "2 mm"]\nalong = [1, 2, 3]\nacross = [0, 1, 0]\ntheta_z_per_F_y = "5 rad/N"\n'
    more += "".join(
        f'theta_{a}_per_M_{a} = "{k}e4 rad/(N*m)"\ndelta_{a}_per_F_{a} = "{k} mm/N"\n' for k, a in enumerate("xyz", 3)
    )
    more = more.removeprefix('[[body]]\nname = "fixed"\n')
    for form in (text, mirrored):
        whole = form.replace("[[actuator]]", more + "[[actuator]]", 1)
        device = loaded(tmp_path, whole)
        document = tomlkit.parse(whole)
        gone = [k for k, e in enumerate(document["element"]) if e["name"] in ("wire", "skewed")]
        first = [k for k, e in enumerate(device.placed_elements) if e.name in ("wire_1", "skewed_1")]
        bodies = [-1, device.bodies.index("mirror"), device.bodies.index("head_1")]
        places = np.array([[0.01, 0.002, 0], [0.002, 0.001, -0.003], [0.012, 0.003, -0.004]])
        K, _ = part_of(device, first, bodies, places)
        for k in reversed(gone):
            del document["element"][k]
        ports = list(zip(("ground", "mirror", "head"), places, strict=True))
        part = super_element(
            "part",
            ports,
            {},
            units='{ length = "mm", force = "N" }',
            pattern='"leg"',
            stiffness=repr(written(K).tolist()),
        )
        other = loaded(tmp_path, document.as_string() + part)
        one, two = (body_matrices(Condensed(d, d.values()))[0] for d in (device, other))
        assert other.size == device.size
        assert np.abs(one - two).max() < SAME * np.abs(one).max()


def test_a_usual_mistake_is_told_with_what_mends_it(tmp_path):
    text, K, M, places = parallelogram(tmp_path)
    right = table(K, M, places)
    loaded(tmp_path, text + right)
    turned = np.kron(np.eye(4), [[0, 1, 0], [0, 0, 1], [1, 0, 0]])
    by_motion = np.arange(12).reshape(2, 6).T.ravel()
    cases = {
        'units.length = "mm"': table(K, M, places, units='{ length = "m", force = "N", mass = "t" }'),
        'order = ["delta_x"': table(K, M, places, order=repr([*FIRST[3:], *FIRST[:3]])),
        "ports in the order 2, 1": table(K, M, places[::-1]),
        'sorted_by = "port"': table(K, M, places, sorted_by='"motion"'),
        'sorted_by = "motion"': table(K, M, places, stiffness=repr(written(K)[np.ix_(by_motion, by_motion)].tolist())),
        "along = [0.0, 1.0, 0.0]": table(K, M, places, stiffness=repr(written(turned @ K @ turned.T).tolist())),
    }
    for mended, wrong in cases.items():
        said = faults(tmp_path, text + wrong)
        assert "a rigid motion meets a load" in said
        assert mended in said, (mended, said)
    assert "held somewhere" in faults(tmp_path, text + table(K + 0.1 * np.diag(np.diag(K)), M, places))
    moved = places + np.array([[0, 0, 0], [0, 0.004, 0]])
    assert "check the places of the ports" in faults(tmp_path, text + table(K, M, moved))


def test_matrices_that_no_part_has_are_refused(tmp_path):
    text, K, M, places = parallelogram(tmp_path)
    skewed = K + 0.1 * np.triu(np.abs(K), 1)
    cases = {
        "is not symmetric: ": table(skewed, M, places),
        "not positive semidefinite": table(_with_an_energy_below_zero(K, places), M, places),
        "check signs": table(-K, M, places),
        "leave stage free": table(_with_an_energy_below_zero(K, places, 1.0), M, places),
        "mass: is not symmetric": table(K, M + 0.1 * np.triu(np.abs(M), 1), places),
        "mass: the part weighs -": table(K, np.kron([[1, -2], [-2, 1]], np.diag([0, 0, 0, 1, 1, 1])), places),
        "above the sum of the others": table(K, on_ports(np.diag([1e-6, 1e-6, 3e-6, 1, 1, 1]), places), places),
        "mass: moved rigidly it is no body": table(K, np.diag(np.diag(M)) @ np.diag([1, 1, 1, 1, 2, 1] * 2), places),
        "six at each of 2 ports are 12": table(K[:6, :6], M, places),
        "all stand on ground": table(K, M, places).replace('body = "stage"', 'body = "ground"'),
        "names a motion twice": table(K, M, places, order=repr(["delta_x"] * 6)),
        "belong together": table(K, M, places, units='{ length = "mm", force = "N" }'),
        "'nowhere' is no body": table(K, M, places).replace('body = "stage"', 'body = "nowhere"'),
        "say nothing of the second order": 'kinematics = "second_order"\n',
        "what they make of its stiffness": 'gravity = ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]\n',
    }
    for said, wrong in cases.items():
        whole = text + wrong if wrong.startswith("[[") else wrong + text + table(K, M, places)
        assert said in faults(tmp_path, whole), said


def on_ports(inertia: np.ndarray, places: np.ndarray) -> np.ndarray:
    """M (6 P, 6 P) of a body whose twist at the origin is the one nearest to the motions of its ports, from that of its twist (6, 6)."""
    nearest = np.linalg.pinv(rigid_motions(places))
    return nearest.T @ inertia @ nearest


def _with_an_energy_below_zero(K: np.ndarray, places: np.ndarray, share: float = 1.1) -> np.ndarray:
    """K with one deformation, of a part of each of its six stiffnesses, that gives back a `share` of what it stored; 1: a joint."""
    by = counted(extent(K, places), 2)
    values, motions = np.linalg.eigh(K * np.outer(by, by))
    load = motions[:, 6:] @ np.sqrt(values[6:]) / by
    return K - share * np.outer(load, load) / 6


def test_the_mass_of_points_is_told_with_their_centre_and_inertia():
    """Summed point by point; rounding of numbers of one size."""
    rng = np.random.default_rng(8)
    masses, at, places = rng.uniform(0.1, 1, 7), rng.normal(size=(7, 3)), rng.normal(size=(3, 3))
    moved = [np.hstack([np.cross(np.eye(3), p).T, np.eye(3)]) for p in at]  # velocity per twist, omega x p + v
    M = on_ports(sum(m * V.T @ V for m, V in zip(masses, moved, strict=True)), places)
    found, centre = rigid_mass(M, places, 1.0), masses @ at / masses.sum()
    off = at - centre
    inertia = sum(m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(masses, off, strict=True))
    assert found.mass == pytest.approx(masses.sum(), rel=1e-12)
    assert np.allclose(found.centre, centre, rtol=0, atol=1e-12)
    assert np.allclose(found.inertia, inertia, rtol=0, atol=1e-11)
    assert found.off < 1e-11


def test_soft_directions_of_a_part_are_freedoms(tmp_path):
    """Both ports in one place, between them four directions that are 1e5 times as stiff as the others."""
    text, *_ = parallelogram(tmp_path)
    stiffnesses = 1e7 * np.array([0.025**2, 0.025**2, 1e-5 * 0.025**2, 1e-5, 1, 1])
    K = np.kron([[1, -1], [-1, 1]], np.diag(stiffnesses))
    units = '{ length = "mm", force = "N" }'
    place = np.array([0, 0.025, 0])
    device = loaded(
        tmp_path,
        text
        + super_element(
            "part", [("ground", place), ("stage", place)], {}, units=units, stiffness=repr(written(K).tolist())
        ),
    )
    assert freedoms(device) == (2, 0)


def test_printed_digits_are_taken_out_and_told(tmp_path):
    """Five printed digits and a ten-thousandth across the diagonal: the model's matrix is symmetric and free to rounding."""
    text, K, M, places = parallelogram(tmp_path)
    printed = np.vectorize(lambda x: float(f"{x:.4e}"))(written(K) * (1 + 1e-4 * np.triu(np.ones_like(K), 1)))
    device = loaded(tmp_path, text + table(K, M, places, stiffness=repr(printed.tolist())))
    notes = " ".join(device.remarks())
    assert "stiffness: rigid motions meet" in notes
    assert "stiffness is not symmetric by 0.01" in notes
    assert "mass is not symmetric" not in notes
    taken, R = device.super_element[0].matrices[0], rigid_motions(places)
    assert np.array_equal(taken, taken.T)
    assert np.abs(taken @ R).max() < 1e-12 * (np.abs(taken) @ np.abs(R)).max()


def test_a_matrix_is_the_same_from_every_kind_of_file(tmp_path):
    text, K, M, places = parallelogram(tmp_path)
    as_stated = loaded(tmp_path, text + table(K, M, places))
    numbers = written(K)
    np.save(tmp_path / "K.npy", numbers)
    np.save(tmp_path / "M.npy", written(M))
    (tmp_path / "K.csv").write_text(
        "# of a program\n" + "\n".join(",".join(map(repr, row)) for row in numbers.tolist())
    )
    scipy.io.mmwrite(tmp_path / "K.mtx", scipy.sparse.coo_matrix(numbers), symmetry="general", precision=17)
    for file in ("K.npy", "K.csv", "K.mtx"):
        device = loaded(tmp_path, text + table(K, M, places, stiffness=repr(file), mass='"M.npy"'))
        assert np.allclose(natural_frequencies(device), natural_frequencies(as_stated), rtol=1e-12)


def test_files_that_hold_no_matrix_are_refused_before_any_work(tmp_path):
    text, K, M, places = parallelogram(tmp_path)

    class Executed:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "executed",))

    np.save(tmp_path / "objects.npy", np.array([Executed()], object), allow_pickle=True)
    (tmp_path / "pickled.npy").write_bytes(pickle.dumps(Executed()))
    with open(tmp_path / "large.csv", "wb") as file:
        file.truncate(LARGEST_FILE + 1)
    (tmp_path / "words.csv").write_text("1, 2\n3, four\n")
    (tmp_path / "ragged.csv").write_text("1, 2\n3\n")
    (tmp_path / "wide.mtx").write_text("%%MatrixMarket matrix coordinate real general\n100000 100000 1\n1 1 1.0\n")
    np.save(tmp_path / "nan.npy", np.full((12, 12), np.nan))
    cases = {
        "objects.npy": "no array of numbers",
        "pickled.npy": "no array of numbers",
        "large.csv": "condensed to its ports",
        "words.csv": "line 2",
        "ragged.csv": "line 2",
        "wide.mtx": "100000 x 100000",
        "nan.npy": "not finite",
        "K.xlsx": "is none of .npy",
        "nothing.csv": "cannot be read",
    }
    (tmp_path / "K.xlsx").write_text("x")
    for name, said in cases.items():
        whole = faults(tmp_path, text + table(K, M, places, stiffness=repr(name)))
        assert said in whole, whole
        assert "super_element[0].stiffness" in whole
    assert not (tmp_path / "executed").exists()


def test_an_uncertain_modulus_and_mass_move_the_model(tmp_path):
    text, K, M, places = parallelogram(tmp_path)
    factors = {"stiffness_factor": '{ value = "1.1", sd = "3 %" }', "mass_factor": '"2"'}
    plain, device = (loaded(tmp_path, text + table(K, M, places, **more)) for more in ({}, factors))
    assert "super_element[0].stiffness_factor" in movable(device)
    one, two = (dm(Condensed(d, d.values()).held_stiffness) for d in (plain, device))
    assert np.allclose(two, 1.1 * one, rtol=1e-12)
    weights = [next(line for line in summary(d) if "weighs" in line) for d in (plain, device)]
    grams = [float(re.search(r"weighs ([\d.]+) g", line)[1]) for line in weights]
    blades = 2 * 25 * 10 * 0.3 * 7.8e-3  # g, of the shipped parallelogram; told to four digits
    assert grams == pytest.approx([blades, 2 * blades], rel=1e-3)


def test_a_part_without_inertia_of_its_ports_has_modes(tmp_path):
    """Lumped masses, on a body that has none itself, leave its turns without inertia: three modes of the body."""
    text, *_ = parallelogram(tmp_path)
    document = tomlkit.parse(text)
    for key in ("mass", "inertia"):
        del document["body"][0][key]
    middle = np.array([[0.0, -0.0125, 0.0], [0.0, 0.0, 0.0]])
    moved = part_of(loaded(tmp_path, dense("parallelogram")), [0, 1], [-1, 0], middle)[0]
    lumped = np.diag([0, 0, 0, 0.01, 0.01, 0.01] * 2)
    device = loaded(tmp_path, document.as_string() + table(moved, lumped, middle))
    compliance = np.linalg.inv(moved[6:, 6:])[3:, 3:]
    expected = np.sqrt(1 / np.linalg.eigvalsh(0.01 * compliance))[::-1] / 2 / np.pi
    assert free_modes(device).frequencies == pytest.approx(expected, rel=1e-9)
    assert freedoms(device)[0] >= 1
    assert load_device(tmp_path / "device.toml") == device


@pytest.mark.long
def test_paths_and_c_of_a_part_by_its_matrices_are_those_of_the_part(tmp_path):
    """The lever stage's circle: drives to 1e-7 of their range, as the inverse is solved to 1e-9 of it; the C compares."""
    scenario = (DEVICES.parent / "lever_circle" / "scenario.toml").read_text()
    scenario = scenario.replace("../devices/xy_lever_stage.toml", "../device.toml")
    drives = []
    for name in ("whole", "by_matrices"):
        folder = tmp_path / name / "lever_circle"
        folder.mkdir(parents=True)
        text = dense("xy_lever_stage").replace('stress_limit = "400 MPa"\n', "")
        device = loaded(folder.parent, text)
        if name != "whole":
            elements = [
                k for k, e in enumerate(device.placed_elements) if e.section.name in ("guide_left", "coupling_left")
            ]
            ends = {b for k in elements for b in (device.placed_elements[k].first, device.placed_elements[k].second)}
            places = device.size * np.random.default_rng(5).uniform(-1, 1, (len(ends), 3))
            loaded(folder.parent, with_part(text, device, folder.parent, elements, sorted(ends), places))
        (folder / "scenario.toml").write_text(scenario)
        report = run(folder / "scenario.toml", tmp_path / f"out_{name}")
        assert report.comparison.passed
        drives.append(report.solution.drive)
    assert np.abs(drives[1] - drives[0]).max() < 1e-7 * np.ptp(drives[0])
    copied = [p for p in (tmp_path / "out_by_matrices").rglob("K.npy")]
    assert copied
    assert all(p.read_bytes() == (tmp_path / "by_matrices" / "K.npy").read_bytes() for p in copied)


@pytest.mark.exhaustive
@pytest.mark.filterwarnings(
    "ignore"
)  # of masses that a drawing without [dynamics] leaves out, of notches between two equations
def test_random_mechanisms_with_a_part_by_its_matrices_are_the_same(tmp_path):
    """Any flexures that nothing else names, condensed to ports at random places: the same printed lines, modes, Jacobian and C."""
    rng, tried = np.random.default_rng(11), 0
    for seed in range(200, 224):
        (folder := tmp_path / str(seed)).mkdir()
        drawn = RandomMechanism(folder, seed)
        text, device = (folder / "device.toml").read_text(), load_device(folder / "device.toml")
        named = {a.on for a in device.actuator} | {r.of for r in device.reading}
        named |= {e.name for e in device.element if e.kind in ("spring", "bent_beam")}
        elements = [k for k, e in enumerate(device.placed_elements) if e.section.name not in named]
        if device.second_order or not elements:
            continue
        bodies = sorted(
            {b for k in elements for b in (device.placed_elements[k].first, device.placed_elements[k].second)}
        )
        places = device.size * rng.uniform(-1, 1, (len(bodies), 3))
        text = re.sub(r"^(stress_limit|rotation_limit) = .*\n", "", text, flags=re.M)
        whole = loaded(folder, text)
        other = loaded(folder, with_part(text, whole, folder, elements, bodies, places))
        # two modes of one frequency have no motions of their own, and so none that another's are like
        lines = [[re.sub(r" \([^)]*\)", "", line) for line in told(d)] for d in (other, whole)]
        assert lines[0] == lines[1], drawn.what
        one, two = (dm(Condensed(d, d.values()).jacobian) for d in (whole, other))
        assert np.abs(one - two).max() < SAME * np.abs(one).max(), drawn.what
        if tried % 5 == 0:
            compared = compare_only(drawn.scenario).comparison
            assert compared is not None
            assert compared.passed, drawn.what
        tried += 1
    assert tried >= 8


def test_a_file_written_elsewhere_still_names_its_matrices(tmp_path):
    text, K, M, places = parallelogram(tmp_path)
    (tmp_path / "out" / "diagnosis").mkdir(parents=True)
    np.save(tmp_path / "K.npy", written(K))
    device = loaded(tmp_path, text + table(K, M, places, stiffness='"K.npy"'))
    target = tmp_path / "out" / "diagnosis" / "device.next.toml"
    target.write_text(
        with_moved_files((tmp_path / "device.toml").read_text(), device.names_files, tmp_path / "device.toml", target)
    )
    assert "../../K.npy" in target.read_text()
    assert summary(load_device(target)) == summary(device)
