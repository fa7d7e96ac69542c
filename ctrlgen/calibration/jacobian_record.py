"""What jacobian.json holds of a calibrated Jacobian, key by key."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from ctrlgen.calibration.home_returns import HomeReturns
from ctrlgen.calibration.measured_jacobian import MeasuredJacobian
from ctrlgen.core.units import base_unit, from_si
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.pose_errors import CHANNELS, PoseErrors
from ctrlgen.reporting.result_file import Keys, Number, Origin, origin

UNITS = ("deg",) * 3 + ("um",) * 3
PARTS = (("rotation", "deg"), ("translation", "um"))


class FewEntry(Keys):
    """One of the few numbers."""

    name: str = Field(description="What it is.")
    unit: str = Field(description="Unit of value and sd.")
    value: float = Field(description="As fitted.")
    sd: float = Field(description="Standard deviation.")


class NormEntry(Keys):
    """Norms of the errors of a set of poses, measured minus expected."""

    poses: str = Field(description="fitted or held out.")
    part: str = Field(description="rotation or translation.")
    unit: str = Field(description="Unit of the four numbers.")
    mean_before: float = Field(description="Mean with the device as described.")
    mean_after: float = Field(description="Mean with the Jacobian.")
    max_before: float = Field(description="Largest with the device as described.")
    max_after: float = Field(description="Largest with the Jacobian.")


class ErrorEntry(Keys):
    """Errors of one component of a set of poses with the Jacobian, measured minus expected."""

    poses: str = Field(description="fitted or held out.")
    channel: str = Field(description="Component of the pose.")
    unit: str = Field(description="Unit of the four numbers.")
    max: float = Field(description="Largest.")
    min: float = Field(description="Smallest.")
    mean: float = Field(description="Mean.")
    sd_of_size: float = Field(description="Standard deviation of their absolute values, as S0 Table 3 has it.")


class HomeEntry(Keys):
    """What the returns to home say of one component."""

    channel: str = Field(description="Component of the pose.")
    unit: str = Field(description="Unit of the six numbers; of the drift, a pose.")
    drift: float = Field(description="Drift of home from one pose to the next.")
    drift_interval: tuple[float, float] = Field(description="95 % interval of the drift.")
    taken_out: bool = Field(
        description="Whether the interval leaves zero out: then the drift was taken out of every pose."
    )
    repeatability: float = Field(description="Standard deviation of home about its drift.")
    repeatability_interval: tuple[float, float] = Field(description="95 % interval of the repeatability.")


class InstrumentEntry(Keys):
    """What one standard deviation of something that is not known exactly of the instruments makes of the calibrated poses."""

    name: str = Field(description="What is not known exactly.")
    source: str = Field(description="Where its standard deviation comes from.")
    rotation_deg: float = Field(description="Norm of the largest rotation error.")
    translation_um: float = Field(description="Norm of the largest translation error.")


class JacobianRecord(Origin):
    """Result of `ctrlgen calibrate --jacobian`: a Jacobian from settled poses."""

    device: str = Field(description="Name of the device.")
    recording: str = Field(description="Title of the recording.")
    drives: list[str] = Field(description="Names of the Jacobian's columns.")
    channels: list[str] = Field(description="Names of its rows.")
    poses_fitted: int = Field(description="How many poses were fitted.")
    poses_held_out: int = Field(description="How many were not.")
    numbers: int = Field(description="How many numbers were fitted, those of the pose at zero drive included.")
    condition: float = Field(description="Condition number of the fitted drives.")
    jacobian: list[list[Number]] = Field(description="Entries in SI.")
    sd: list[list[Number]] = Field(description="Their standard deviations in SI.")
    offset: list[Number] = Field(description="Pose read at zero drive, in SI.")
    few: list[FewEntry] = Field(description="What was fitted instead of all entries; empty otherwise.")
    norms: list[NormEntry] = Field(description="One entry a set of poses and part.")
    errors: list[ErrorEntry] = Field(description="One entry a set of poses and component.")
    home_returns: int = Field(
        description="Returns to home that drift and repeatability are from; 0 where they are too few."
    )
    home: list[HomeEntry] = Field(description="One entry a component; empty where there are too few returns.")
    instruments: list[InstrumentEntry] = Field(
        description="What the instruments may feign; empty where nothing is stated of them."
    )


def jacobian_record(found: MeasuredJacobian) -> JacobianRecord:
    """Plain numbers of a calibrated Jacobian."""
    return JacobianRecord(
        **origin({name: read.sha256 for name, read in found.inputs.items()}, None, tuple(found.recording.notes)),
        device=found.device.name,
        recording=found.recording.title,
        drives=list(drives_of(found)),
        channels=list(CHANNELS),
        poses_fitted=int((~found.held_out).sum()),
        poses_held_out=int(found.held_out.sum()),
        numbers=found.numbers,
        condition=found.condition,
        jacobian=found.jacobian.tolist(),
        sd=found.sd.tolist(),
        offset=found.offset.tolist(),
        few=[FewEntry(name=n.name, unit=n.unit, value=n.value, sd=n.sd) for n in found.few],
        norms=[_norm(which, part, unit, b, a) for which, b, a in sets_of(found) for part, unit in PARTS],
        errors=[_error(which, k, a) for which, _, a in sets_of(found) for k in range(6)],
        home_returns=0 if found.home is None else len(found.home.order),
        home=[] if found.home is None else [_home(k, found.home) for k in range(6)],
        instruments=[
            InstrumentEntry(
                name=share.name,
                source=share.source,
                rotation_deg=float(from_si(share.rotation, "deg")),
                translation_um=float(from_si(share.translation, "um")),
            )
            for share in found.instruments
        ],
    )


def drives_of(found: MeasuredJacobian) -> tuple[str, ...]:
    """Names of the drives, in the order of the Jacobian's columns."""
    return tuple(build_model(found.device).signals["drive"].channels)


def units_of(found: MeasuredJacobian) -> tuple[str, ...]:
    """SI units of the Jacobian's rows, such as rad/V; of drives of several kinds, rad per SI unit of the drive."""
    of_drives = {base_unit(unit) for unit in build_model(found.device).signals["drive"].units}
    per = of_drives.pop() if len(of_drives) == 1 else "SI"
    return tuple(f"{unit}/{per}" for unit in ("rad",) * 3 + ("m",) * 3)


def sets_of(found: MeasuredJacobian) -> list[tuple[str, PoseErrors, PoseErrors]]:
    """The fitted poses, then those held out where there are some: name, errors as described, errors with the Jacobian."""
    chosen = [("fitted", ~found.held_out), ("held out", found.held_out)]
    return [
        (w, PoseErrors(found.before.errors[m]), PoseErrors(found.after.errors[m])) for w, m in chosen if m.sum() > 1
    ]


def norms_of(errors: PoseErrors, part: str, unit: str) -> tuple[float, float]:
    """Mean and largest norm of the errors of `part` in `unit`."""
    norms = np.asarray(from_si(getattr(errors, part), unit))
    return float(norms.mean()), float(norms.max())


def _norm(which: str, part: str, unit: str, before: PoseErrors, after: PoseErrors) -> NormEntry:
    (b, b_max), (a, a_max) = norms_of(before, part, unit), norms_of(after, part, unit)
    numbers = {"mean_before": b, "mean_after": a, "max_before": b_max, "max_after": a_max}
    return NormEntry(poses=which, part=part, unit=unit, **numbers)


def _home(k: int, home: HomeReturns) -> HomeEntry:
    unit = UNITS[k]

    def pair(interval: np.ndarray) -> tuple[float, float]:
        low, high = (float(from_si(float(end), unit)) for end in interval)
        return low, high

    return HomeEntry(
        channel=CHANNELS[k],
        unit=unit,
        drift=float(from_si(float(home.drift[k]), unit)),
        drift_interval=pair(home.drift_interval[k]),
        taken_out=bool(home.drifts[k]),
        repeatability=float(from_si(float(home.repeatability[k]), unit)),
        repeatability_interval=pair(home.repeatability_interval[k]),
    )


def _error(which: str, k: int, errors: PoseErrors) -> ErrorEntry:
    signed, unit = errors.signed, UNITS[k]
    named = {"max": signed.maximum, "min": signed.minimum, "mean": signed.mean, "sd_of_size": errors.absolute.sd}
    numbers = {name: float(from_si(float(values[k]), unit)) for name, values in named.items()}
    return ErrorEntry(poses=which, channel=CHANNELS[k], unit=unit, **numbers)
