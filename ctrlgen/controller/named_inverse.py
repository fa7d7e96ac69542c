"""The inverse of a model with its numbers as formulas of the device's parameters, so that the C can name them."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from ctrlgen.devices import Device
from ctrlgen.model.assembly import symbolic_model
from ctrlgen.model.inverse import Inverse, invert
from ctrlgen.model.model import Model

MOST_OPERATIONS = 100_000
"""Of the forces' balance with its numbers as symbols. Shipped devices have up to 4,500, drawn hexapods 11,000; three million, of hexapods
whose flexures stretch where they are held, take minutes and gigabytes to invert, and their formulas would fill a book."""


@dataclass(frozen=True)
class NamedInverses:
    """Kernels for equilibria and for the next sample with an argument "p" more, their `model`, and value and path of each number of p.
    Of a model with more drives than axes there are none, and of one with formulas beyond `MOST_OPERATIONS` no numbers either."""

    static: Inverse | None
    moving: Inverse | None
    model: Model
    numbers: list[tuple[float, str]]


def named_inverses(device: Device, follow: str, sample_time: float | None) -> NamedInverses:
    """The inverses of `device` for the signal named `follow` with formulas; without any where nobody could read them."""
    model = symbolic_model(device)
    if ca.n_nodes(model.balance) > MOST_OPERATIONS:
        return NamedInverses(None, None, symbolic_model(device, ()), [])
    return _inverses(model, follow, sample_time)


def given_inverses(device: Device, follow: str, sample_time: float | None) -> NamedInverses:
    """The inverses in terms of the numbers alone that the C is given when it starts, `Device.given_at_start`."""
    return _inverses(symbolic_model(device, [c.path for c in device.given_at_start]), follow, sample_time)


def _inverses(model: Model, follow: str, sample_time: float | None) -> NamedInverses:
    square = not model.redundant
    next_sample = None if sample_time is None or not square else invert(model, follow, sample_time, symbolic=True)
    paths = [symbol.name() for symbol in ca.vertsplit(model.p)]
    numbers = list(zip(model.p_nominal.tolist(), paths, strict=True))
    return NamedInverses(invert(model, follow, None, symbolic=True) if square else None, next_sample, model, numbers)
