"""Parts of a mechanism as a finite-element program would condense them, and devices in which they stand in place of the parts."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import tomlkit
from mechanism_files import dm

from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.physics.rigid_bodies import GROUND
from ctrlgen.physics.stated_part import rigid_motions

FIRST = ["delta_x", "delta_y", "delta_z", "theta_x", "theta_y", "theta_z"]
SWAP = [3, 4, 5, 0, 1, 2]


def part_of(device, elements: list[int], bodies: list[int], places: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
    """K and M (6 P, 6 P) of some `elements` of a device, condensed to ports at `places` (P, 3) [m] on `bodies` (P,); SI, twists
    (theta; delta) -> (M; F). Bodies between them that have no port follow, and have no mass."""
    c = Condensed(device, device.values())
    nodes = sorted({b for k in elements for b in (c.elements[k].first, c.elements[k].second)} | set(bodies))
    K, M = np.zeros((2, 6 * len(nodes), 6 * len(nodes)))
    for k in elements:
        e = c.elements[k]
        rows = np.concatenate([6 * nodes.index(b) + np.arange(6) for b in (e.first, e.second)])
        K[np.ix_(rows, rows)] += np.kron([[1, -1], [-1, 1]], dm(e.stiffness)[SWAP])
        inertia = c.flexure_mass(k, ca.DM.eye(12)[:6, :], ca.DM.eye(12)[6:, :])
        if inertia is not None:
            M[np.ix_(rows, rows)] += dm(inertia)
    kept = np.concatenate([6 * nodes.index(b) + np.arange(6) for b in bodies])
    left = np.setdiff1d(np.arange(len(K)), kept)
    moved = np.zeros((len(K), len(kept)))
    moved[kept] = np.eye(len(kept))
    size = np.where(np.arange(len(K)) % 6 < 3, 1 / device.size, 1.0)  # turns as displacements: of a better condition
    counted = K * np.outer(size, size)
    follows = -np.linalg.solve(counted[np.ix_(left, left)], counted[np.ix_(left, kept)])
    moved[left] = size[left, None] * follows / size[kept]
    K, M = moved.T @ K @ moved, moved.T @ M @ moved
    to_ports = np.zeros((len(kept), len(kept)))
    for i, place in enumerate(places):  # the twist of a body at the origin from that of its port
        at = slice(6 * i, 6 * i + 6)
        to_ports[at, at] = np.linalg.inv(rigid_motions(place[None]))
    K, M = (to_ports.T @ X @ to_ports for X in (K, M))
    return (K + K.T) / 2, (M + M.T) / 2 if np.any(M) else None


def written(K: np.ndarray, order: list[str] = FIRST) -> np.ndarray:
    """A matrix of SI as a program with mm, N and t writes it: N/mm are 1e3 N/m, and t 1e3 kg."""
    twist = ["theta_x", "theta_y", "theta_z", "delta_x", "delta_y", "delta_z"]
    ports = len(K) // 6
    rows = np.concatenate([6 * i + np.array([twist.index(name) for name in order]) for i in range(ports)])
    units = np.tile([1.0 if name.startswith("delta") else 1e3 for name in order], ports)
    return K[np.ix_(rows, rows)] * np.outer(units, units) * 1e-3


def super_element(name: str, ports: list[tuple[str, np.ndarray]], files: dict[str, str], **more: str) -> str:
    """The table, with K and M in `files`, in mm, N and t."""
    mass = ', mass = "t"' if "mass" in files or "mass" in more else ""
    stated = {"units": f'{{ length = "mm", force = "N"{mass} }}', "order": repr(FIRST)}
    stated |= {key: repr(file) for key, file in files.items()} | more
    text = f'[[super_element]]\nname = "{name}"\nsource = "condensed by a test"\n'
    text += "".join(f"{key} = {value}\n" for key, value in stated.items())
    for body, at in ports:
        place = ", ".join(f'"{float(x)!r} m"' for x in at)
        text += f'[[super_element.port]]\nbody = "{body}"\nat = [{place}]\n'
    return text


def with_part(text: str, device, folder: Path, elements: list[int], bodies: list[int], places: np.ndarray) -> str:
    """The text of a device file in which the placed `elements` are a super-element with the files K.npy and M.npy in `folder`."""
    K, M = part_of(device, elements, bodies, places)
    np.save(folder / "K.npy", written(K))
    files = {"stiffness": "K.npy"}
    if M is not None:
        np.save(folder / "M.npy", written(M))
        files |= {"mass": "M.npy"}
    document = tomlkit.parse(text)
    gone = {device.placed_elements[k].section.name for k in elements}
    for k in reversed(range(len(document["element"]))):
        if document["element"][k]["name"] in gone:
            del document["element"][k]
    if not len(document["element"]):
        del document["element"]
    names = ["ground" if b == GROUND else device.bodies[b] for b in bodies]
    return document.as_string() + super_element("part", list(zip(names, places, strict=True)), files)
