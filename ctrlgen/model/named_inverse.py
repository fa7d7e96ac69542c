"""The inverse of a model with its numbers as formulas of the device's parameters, so that the C can name them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import casadi as ca

from ctrlgen.devices import Device
from ctrlgen.model.assembly import symbolic_model
from ctrlgen.model.inverse import Inverse, invert
from ctrlgen.model.model import Model


@dataclass(frozen=True)
class NamedInverses:
    """Kernels for equilibria and for the next sample with an argument "p" more, their `model`, and value and path of each number of p."""

    static: Inverse
    moving: Inverse | None
    model: Model
    numbers: list[tuple[float, str]]


def named_inverses(
    device: Device, follow: str, sample_time: float | None, static: Inverse, moving: Inverse | None
) -> NamedInverses:
    """The inverses `static` and `moving` with formulas. Displacements stay theirs, because the slope of the pose is inverted in numbers."""
    model = symbolic_model(device)
    at_rest = replace(invert(model, follow, None, symbolic=True), displacement=static.displacement)
    next_sample = None
    if moving is not None:
        next_sample = replace(invert(model, follow, sample_time, symbolic=True), displacement=moving.displacement)
    paths = [symbol.name() for symbol in ca.vertsplit(model.p)]
    return NamedInverses(at_rest, next_sample, model, list(zip(model.p_nominal.tolist(), paths, strict=True)))
