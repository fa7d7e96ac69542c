"""An X-Y stage in balance, each axis with a drive of its own."""

from __future__ import annotations

from ctrlgen.core.files import validate
from ctrlgen.devices import Device


def xy_stage(way: str, high: str) -> Device:
    """A stage that goes a `way` a volt along each axis, up to `high`."""
    table = {
        "kind": "matrix",
        "name": "stage",
        "title": "an X-Y stage",
        "source": "round numbers",
        "directions": ["delta_x", "delta_y"],
        "channels": ["delta_x", "delta_y"],
        "jacobian": [[f"{way} um/V", "0 um/V"], ["0 um/V", f"{way} um/V"]],
        "actuator": [{"name": name, "low": "0 V", "high": high} for name in ("x", "y")],
    }
    return validate(Device.library["matrix"], table, "device")
