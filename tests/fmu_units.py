"""The co-simulation units as FMPy runs them."""

from __future__ import annotations

from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from conftest import AXIS_FILE

from ctrlgen import load_scenario

fmpy = pytest.importorskip("fmpy", reason="FMPy is missing, the units were not run: pip install 'ctrlgen[fmi]'")
for part in ("fmi1", "fmi2", "fmi3", "validation"):
    import_module(f"fmpy.{part}")

CREEP = {"kind": "creep", "at": "all", "gain": "0.03", "tau": "20 ms", "slow": "0.3"}
MEAN = {"kind": "moving_average", "at": "all", "window": "5.4 ms"}
DELAY = {"kind": "delay", "at": "all", "delay": "2.5 ms"}


class Unit:
    """One instance of an FMU, stepped by its sample time; variables by name, or by the beginning of their names."""

    def __init__(self, path: Path, folder: Path, **start: bool) -> None:
        self.about = fmpy.read_model_description(str(path))
        if not folder.exists():  # a loaded library must not be written over
            fmpy.extract(str(path), str(folder))
        self.three = self.about.fmiVersion == "3.0"
        self.fmu = (fmpy.fmi3.FMU3Slave if self.three else fmpy.fmi2.FMU2Slave)(
            guid=self.about.guid, unzipDirectory=str(folder), modelIdentifier=self.about.coSimulation.modelIdentifier
        )
        self.fmu.instantiate()
        self.sample_time = float(self.about.defaultExperiment.stepSize)
        self.start_settled = start.get("start_settled", False)

    def references(self, what: str) -> list[int]:
        """Value references of the variable `what`, or of `what_...`, in their order."""
        found = [v.valueReference for v in self.about.modelVariables if v.name == what or v.name.startswith(f"{what}_")]
        assert found, what
        return found

    def set(self, what: str, values: np.ndarray) -> None:
        (self.fmu.setFloat64 if self.three else self.fmu.setReal)(self.references(what), list(map(float, values)))

    def get(self, what: str) -> np.ndarray:
        return np.array((self.fmu.getFloat64 if self.three else self.fmu.getReal)(self.references(what)))

    @property
    def status(self) -> int:
        return (self.fmu.getInt32 if self.three else self.fmu.getInteger)(self.references("status"))[0]

    def begin(self, what: str, values: np.ndarray, seen: str = "", at: float = 0.0) -> np.ndarray | None:
        """Initialized with these inputs; the output `seen` as it is before initialization ends."""
        if self.start_settled:
            self.fmu.setBoolean(self.references("start_settled"), [True])
        if self.three:
            self.fmu.enterInitializationMode(startTime=at)
        else:
            self.fmu.setupExperiment(startTime=at)
            self.fmu.enterInitializationMode()
        self.set(what, values)
        early = self.get(seen) if seen else None
        self.fmu.exitInitializationMode()
        self.time = at
        return early

    def step(self, samples: float = 1) -> None:
        size = samples * self.sample_time
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=size)
        self.time += size

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()


@contextmanager
def opened(path: Path, folder: Path, **start: bool):
    """A unit, ended and freed afterwards."""
    unit = Unit(path, folder, **start)
    try:
        yield unit
    finally:
        unit.close()


def apart(ours: np.ndarray, expected: np.ndarray) -> float:
    """The largest difference, per channel's largest size."""
    size = np.maximum(np.max(np.abs(expected), axis=0), 1e-300)
    return float(np.max(np.abs(ours - expected) / size))


def run_plant(unit: Unit, drives: np.ndarray, roles: list[str]) -> dict[str, np.ndarray]:
    """Outputs at the start and at the end of every sample."""
    unit.begin("drive", drives[0])
    rows = {role: [unit.get(role)] for role in roles}
    for drive in drives:
        unit.set("drive", drive)
        unit.step()
        for role in roles:
            rows[role].append(unit.get(role))
    return {role: np.array(values) for role, values in rows.items()}


def axis_scenario(folder: Path, more: str = ""):
    """A scenario on the axis with inertia, with `more` in its device file."""
    (folder / "device.toml").write_text(AXIS_FILE.read_text() + more)
    (folder / "scenario.toml").write_text(
        'title = "a line"\ndevice = "device.toml"\nsample_rate = "2 kHz"\n'
        'duration = "0.1 s"\n[path]\nkind = "line"\nstart = {}\nend = { axis = "10 um" }\n'
    )
    return load_scenario(folder)
