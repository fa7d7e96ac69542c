"""Prints what `ctrlgen diagnose` finds in this recording: each correction by its size, and the errors beside the paper's.

python scenarios/nist_hexapod/account.py
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

import numpy as np

import ctrlgen
from ctrlgen import Diagnosis
from ctrlgen.core.shipped_files import shipped_package
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.calibration import calibrate_jacobian
from ctrlgen.recordings.pose_errors import PoseErrors
from ctrlgen.recordings.reader import load_recordings

HERE = Path(__file__).parent
S0 = import_module(f"{shipped_package('papers').__name__}.s0_data")
TWO_COMPONENTS = slice(24, 54)  # the poses held out


def errors_without(found: Diagnosis, k: int | None = None) -> PoseErrors:
    """Held-out errors of the device found, or without its cause `k`, the others as they are."""
    fit = found.search.chosen.fit
    s = fit.structure
    cooled = Structure(s.device, s.causes, tuple(fit.values(i) for i in range(len(s.causes))))
    other = fit if k is None else found.fitter.fit(cooled.without(k), steps=0)
    return PoseErrors(np.vstack([r.observed - found.fitter.predict(other, r) for r in found.fitter.held_out_records]))


def fairly(found: Diagnosis) -> PoseErrors:
    """Held-out errors of the paper's way, 36 numbers of a Jacobian, fitted to the poses that the diagnosis was fitted to."""
    fitted, held = found.fitter.fit_records, found.fitter.held_out_records
    inputs, poses = (np.vstack([getattr(r, name) for r in fitted]) for name in ("drive", "observed"))
    jacobian = calibrate_jacobian(inputs, poses).jacobian
    return PoseErrors(np.vstack([r.observed - r.drive @ jacobian.T for r in held]))


def means(errors: PoseErrors) -> str:
    """The paper's two figures: mean length of the translation and of the rotation error."""
    return f"{1e6 * errors.translation.mean():8.3f} um {np.rad2deg(errors.rotation.mean()):9.5f} deg"


def main() -> None:
    """Diagnoses and prints."""
    device = ctrlgen.load_device(HERE.parent / "devices" / "meso_hexapod.toml")
    found = ctrlgen.diagnose(device, load_recordings([HERE], build_model(device)))
    *_, data = S0.load_s0()
    paper = PoseErrors(data.measured - data.commanded)  # commanded through its calibrated Jacobian
    unseen = PoseErrors(paper.errors[TWO_COMPONENTS])
    fit = found.search.chosen.fit
    nominal = found.search.nominal.fit
    before = PoseErrors(
        np.vstack([r.observed - found.fitter.predict(nominal, r) for r in found.fitter.held_out_records])
    )
    free = sum(u.cause is not None for u in fit.structure.free_parameters)
    print(f"{found.verdict}: {len(fit.structure.causes)} corrections, {free} free numbers fitted to 24 poses")
    print(f"30 poses not fitted, as described                      {means(before)}")
    print(f"30 poses not fitted, corrected                         {means(errors_without(found))}")
    print(f"the same 30, 36 numbers fitted to the same 24 poses    {means(fairly(found))}")
    print(f"the same 30, paper's 36 numbers, fitted to them too    {means(unseen)}")
    print(f"all 54, paper's                                        {means(paper)}")
    print("without one correction, the others as they are:")
    rows = [(errors_without(found, k), k, cause, fit.values(k)) for k, cause in enumerate(fit.structure.causes)]
    for errors, k, cause, values in sorted(rows, key=lambda row: -row[0].translation.mean()):
        fitted = {u.name for u in fit.structure.free_parameters if u.cause == k}
        numbers = ", ".join(f"{name} = {value:.6g}" for name, value in values.items() if name in fitted) or "no number"
        print(f"  {means(errors)}  {cause.effect} at {cause.location} (SI: {numbers})")


if __name__ == "__main__":
    main()
