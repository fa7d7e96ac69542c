"""Other ways to explain the same files: the nominal refitted, PySINDy, SysIdentPy; their error on the held-out record.

Axis cases in open loop only. Errors are free-run predictions over the noise's true standard deviation.
"""

from __future__ import annotations

import csv
import tomllib
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import savgol_filter

from battery.judge import Judgement
from battery.plant_axis import Array, Axis, Scene, move, read
from battery.seal import unseal

Series = tuple[Array, Array]


def read_case(case: Path) -> tuple[Axis, dict[str, Series], bool]:
    """The axis as stated, {role: (u [V], y [um])} and whether the drive is linear between samples, from the case's own files."""
    d = tomllib.loads((case / "device.toml").read_text())
    number = {
        k: float(d[s][k]["value"].split(" ")[0])
        for s, k in (
            ("mechanics", "mass"),
            ("mechanics", "damping"),
            ("mechanics", "stiffness"),
            ("actuator", "force_constant"),
        )
    }
    axis = Axis(**number, stroke=1e-4, drive_limit=float(d["actuator"]["drive_limit"].split(" ")[0]))
    recording = tomllib.loads((case / "recording.toml").read_text())
    series = {}
    for record in recording["record"]:
        with (case / record["file"]).open() as f:
            rows = np.array([[float(x) for x in row] for row in list(csv.reader(f))[1:]])
        series[record["role"]] = rows[:, 1], rows[:, 2]
    return axis, series, recording["record"][0]["between_samples"] == "linear"


def nominal(axis: Axis, series: dict[str, Series], linear: bool) -> Array:
    """Least squares on m, c, k (k_f is redundant) and an offset, robust to spikes; held-out residual [um]."""

    def model(p: Array, u: Array) -> Array:
        a = replace(axis, mass=axis.mass * p[0], damping=axis.damping * p[1], stiffness=axis.stiffness * p[2])
        return read(move(a, u, scene=Scene(a).rough, linear=linear)) * 1e6 + p[3]

    u, y = series["fit"]
    scale = 3 * np.std(np.diff(y, 3)) / np.sqrt(20) + 1e-6
    fit = least_squares(
        lambda p: (model(p, u) - y) / scale, [1, 1, 1, 0], loss="soft_l1", x_scale=[0.01, 0.05, 0.01, 0.01], max_nfev=15
    )
    return model(fit.x, series["hold_out"][0]) - series["hold_out"][1]


def sindy(axis: Axis, series: dict[str, Series], linear: bool) -> Array:
    """PySINDy: cubic library of (q, v, u), derivatives by Savitzky-Golay; best of five thresholds, two windows, on the fit record.

    A held drive jumps at the samples: what acts on average around sample k is the mean of both sides.
    """
    import pysindy

    u, y = series["fit"]
    held_u, held_y = series["hold_out"]
    dt, scale, size = 1e-3, np.std(y), np.std(u)
    around = (u if linear else (u + np.append(u[:1], u[:-1])) / 2) / size
    best, error = held_y * np.nan, np.inf
    for window in (5, 7):
        q, v, a = (savgol_filter(y / scale, window, 4, deriv=d, delta=dt) for d in range(3))
        rate = np.std(v)
        X, dX = np.column_stack([q, v / rate]), np.column_stack([v, a / rate])
        for threshold in (0.0, 0.01, 0.1, 1.0, 10.0):
            optimizer = pysindy.STLSQ(threshold=threshold, alpha=1e-6)
            m = pysindy.SINDy(optimizer=optimizer, feature_library=pysindy.PolynomialLibrary(3))
            m.fit(X, t=dt, x_dot=dX, u=around[:, None])
            inside = _free(m, u / size, dt)[:, 0] * scale - y
            if np.isfinite(inside).all() and np.std(inside) < error:
                best, error = _free(m, held_u / size, dt)[:, 0] * scale - held_y, float(np.std(inside))
    return best


def _free(m: Any, u: Array, dt: float) -> Array:
    """Free run from rest by the fourth-order Runge-Kutta rule, drive held, written out on the model's coefficients."""
    powers = np.array(m.feature_library.powers_)
    C = np.array(m.coefficients())
    x, out = np.zeros(2), np.zeros((len(u), 2))

    def rate(x: Array, command: float) -> Array:
        return C @ np.prod(np.array([x[0], x[1], command]) ** powers, axis=1)

    for k, command in enumerate(u):
        out[k] = x
        a = rate(x, command)
        b = rate(x + dt / 2 * a, command)
        c = rate(x + dt / 2 * b, command)
        x = x + dt / 6 * (a + 2 * b + 2 * c + rate(x + dt * c, command))
        if not np.abs(x).max() < 1e3:
            out[k:] = np.nan
            break
    return out


def narmax(axis: Axis, series: dict[str, Series], linear: bool) -> Array:
    """SysIdentPy: polynomial NARX of degree 3, two lags, fifteen terms by FROLS."""
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    u, y = series["fit"]
    held_u, held_y = series["hold_out"]
    scale, size = np.std(y), np.std(u)
    m = FROLS(
        order_selection=False, n_terms=15, ylag=2, xlag=2, estimator=LeastSquares(), basis_function=Polynomial(degree=3)
    )
    m.fit(X=u[:, None] / size, y=y[:, None] / scale)
    predicted = m.predict(X=held_u[:, None] / size, y=held_y[:, None] / scale)
    return predicted[:, 0] * scale - held_y


RUNNERS: dict[str, tuple[str | None, Callable[[Axis, dict[str, Series], bool], Array]]] = {
    "nominal refitted": (None, nominal),
    "PySINDy": ("pysindy", sindy),
    "SysIdentPy": ("sysidentpy", narmax),
}


def run_one(folder: Path, case: str, kind: str) -> list[dict[str, Any]]:
    """Held-out error over the noise of every opponent on one case; a reason instead where it did not run."""
    noise = unseal(folder / "answers" / f"{case}.json")["noise"]["sd"] * 1e6
    out = []
    for name, (package, runner) in RUNNERS.items():
        row: dict[str, Any] = {"case": case, "class": kind, "opponent": name, "ratio": None, "why": None}
        if package and not find_spec(package):
            row["why"] = "not run: pip install 'ctrlgen[opponents]'"
        else:
            try:
                with warnings.catch_warnings(), np.errstate(all="ignore"):
                    warnings.simplefilter("ignore")
                    error = runner(*read_case(folder / "cases" / case))
                finite = bool(np.isfinite(error).all())
                row["ratio"] = float(np.sqrt(np.mean(error**2))) / noise if finite else None
                row["why"] = None if finite else "diverged"
            except (ValueError, np.linalg.LinAlgError, FloatingPointError) as failure:
                row["why"] = f"failed: {failure}"
        out.append(row)
    return out


def run_all(folder: Path, judged: Sequence[Judgement], per_class: int, jobs: int) -> list[dict[str, Any]]:
    """The first `per_class` open-loop axis cases of each class."""
    from concurrent.futures import ProcessPoolExecutor

    chosen: list[Judgement] = []
    for j in judged:
        device = (folder / "cases" / j.case / "device.toml").read_text()
        alike = sum(1 for c in chosen if c.kind == j.kind)
        if 'kind = "axis"' in device and "[loop]" not in device and alike < per_class:
            chosen.append(j)
    with ProcessPoolExecutor(jobs) as pool:
        rows = pool.map(run_one, [folder] * len(chosen), [j.case for j in chosen], [j.kind for j in chosen])
        return [row for group in rows for row in group]


def summary(rows: Sequence[dict[str, Any]], judged: Sequence[Judgement]) -> list[str]:
    """A table: median held-out error / noise per class, opponents and ctrlgen on the same cases; diverged counts as infinite."""
    lines = ["| held-out error / noise, median | " + " | ".join([*RUNNERS, "ctrlgen (over its floor)"]) + " |"]
    lines.append("|---|" + "---|" * (len(RUNNERS) + 1))
    for kind in sorted({r["class"] for r in rows}):
        cells = []
        for name in RUNNERS:
            mine = [r for r in rows if r["class"] == kind and r["opponent"] == name]
            if any((r["why"] or "").startswith("not run") for r in mine):
                cells.append("not run")
                continue
            cells.append(f"{np.median([np.inf if r['ratio'] is None else r['ratio'] for r in mine]):.3g}")
        cases = {r["case"] for r in rows if r["class"] == kind}
        own = [np.inf if j.ratio is None else j.ratio for j in judged if j.case in cases]
        lines.append(f"| {kind} ({len(cases)}) | " + " | ".join([*cells, f"{np.median(own):.3g}"]) + " |")
    return lines
