"""Controller and plant as FMI 3.0 or 2.0 co-simulation units (FMUs), each around the C that runs elsewhere.

The internal step is the sample time; a communication step is a whole number of samples, inputs held over it.
`target` is what the controller is to reach at the end of a step and its `drive` acts during that same step: in a
loop, step the controller first, hand its drives on, then step the plant.

FMI 2.0 stays beside 3.0 because tools that import it alone are in use: Simulink to R2022b, and OpenModelica, whose importer answered
an FMI 3.0 unit with nothing until August 2026 and takes 3.0 for model exchange alone since (OpenModelica/OpenModelica#16268;
OpenModelica/OMSimulator#1523). These units are for co-simulation. It costs two templates and a table of calls.
"""

from __future__ import annotations

import hashlib
import io
import platform
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.core.errors import CtrlgenError, Fault, InputError, ToolError
from ctrlgen.core.files import whole_folder, write_bytes
from ctrlgen.core.units import base_unit, exponents, from_si
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import write
from ctrlgen.firmware.c.toolchains import compile_c, find_compilers
from ctrlgen.firmware.fmi.fmi_calls import FOREIGN_TYPES, REFUSED_2, REFUSED_3
from ctrlgen.firmware.fmi.plant import Plant, plant_of, write_plant
from ctrlgen.firmware.online.online import online_context
from ctrlgen.firmware.player_only import check_online
from ctrlgen.model.model import Model
from ctrlgen.trajectory.scenario import Scenario, check_tightened, model_of
from ctrlgen.version import __version__, program

VERSIONS = (3, 2)
ZIP_TIME = (1980, 1, 1, 0, 0, 0)  # of every file in an FMU, so that the same input gives the same bytes
SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}


@dataclass(frozen=True)
class Variable:
    """One variable of a unit; `attributes` are those of its type, as in the XML."""

    reference: int
    name: str
    causality: str
    variability: str
    description: str
    attributes: dict[str, str]
    type: str = "Float64"

    @property
    def type_2(self) -> str:
        """The name of the variable's type in FMI 2.0."""
        return {"Float64": "Real", "Int32": "Integer", "Boolean": "Boolean"}[self.type]


@dataclass(frozen=True)
class FmiUnit:
    """A physical unit of the XML: `exponents` of the SI base units, and `displayed` (name, factor, offset) beside it."""

    name: str
    exponents: dict[str, int] | None
    displayed: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True)
class Fmus:
    """What was written.

    `paths` of the units; `binary`: the platform they run on, None where only sources were written. `remark` says why a
    binary or the controller is missing.
    """

    paths: tuple[Path, ...]
    binary: str | None
    remark: str


@dataclass(frozen=True)
class _Unit:
    """A unit before it is written: what the templates read."""

    kind: str
    core: str
    title: str
    inputs: list[Variable]
    outputs: list[Variable]
    status: Variable | None
    settles: Variable | None
    more: dict[str, Any]

    @property
    def variables(self) -> list[Variable]:
        """The variables, without the time, by value reference."""
        return [*self.inputs, *self.outputs, *(v for v in (self.status, self.settles) if v)]


def write_fmus(scenario: Scenario, out: Path, fmi: int = 3, limited: Model | None = None) -> Fmus:
    """Writes `{scenario}_controller.fmu` and `{scenario}_plant.fmu` to the folder `out`, for FMI `fmi` (3 or 2).

    With binaries for this computer where a C compiler is found, and the sources in any case. A device with inertia that has states
    which its motion does not determine gets no controller. The controller keeps the limits of the model `limited`, that of a robust
    solution; by default those of the device. Raises InputError for a scenario without a sample rate, or one whose limits are to
    be tightened and are not, ToolError where a compiler refuses.
    """
    if fmi not in VERSIONS:
        raise InputError("--fmi", [Fault(str(fmi), "is not a supported FMI version; use 3 or 2")])
    if scenario.sample_time is None:
        what = 'is missing: FMI co-simulation advances by samples; add sample_rate = "1 kHz" and duration = "1 s"'
        raise InputError(scenario.path, [Fault("sample_rate", what)])
    plant, remark = plant_of(scenario), ""
    check_tightened(scenario, limited or plant.model)
    try:
        compiler: str | None = next(iter(find_compilers()))
    except ToolError as error:
        compiler, remark = None, f"sources only, no binary: {error}"
    with whole_folder(Path(out)) as draft, tempfile.TemporaryDirectory(prefix="ctrlgen-") as scratch:
        units = [_plant_unit(scenario, plant, Path(scratch))]
        try:
            led = model_of(scenario)
            led = led if limited is None else led.limited_as(limited)
            units.insert(0, _controller_unit(scenario, led, plant.sample_time, Path(scratch)))
        except InputError as error:
            if not (plant.inertial or plant.model.redundant or plant.model.rate_limits):
                raise
            remark = f"{remark} no controller: {'; '.join(fault.what for fault in error.faults)}"
        names = [_write_unit(scenario, plant, unit, fmi, Path(scratch), compiler, draft) for unit in units]
    binary = None if compiler is None else _platform(fmi)[0]
    return Fmus(tuple(Path(out) / name for name in names), binary, remark.strip())


def _controller_unit(scenario: Scenario, model: Model, sample_time: float, folder: Path) -> _Unit:
    """The online controller's C in `folder`, and the unit around it."""
    check_online(scenario, model)
    controller = controller_of(model, scenario.file.follow, sample_time, scenario.file.leads_modes)
    m, core = controller.kernels.nominal, f"{scenario.controller_name}_online_{Real.DOUBLE.suffix}"
    context = online_context(scenario, controller, Real.DOUBLE, core)
    for end in ("h", "c"):
        write(f"online.{end}", context, folder / f"{core}.{end}")
    followed, drive, displacement = controller.kernels.target, m.signals["drive"], m.signals["displacement"]
    inputs = _variables("target", followed, "input", "discrete", 1, np.zeros(len(followed.channels)))
    low, high = m.u_bounds
    outputs = _variables("drive", drive, "output", "discrete", 1 + len(inputs), bounds=(low, high))
    groups = [("drive", 0), ("displacement", len(outputs))]
    outputs += _variables("displacement", displacement, "output", "discrete", 1 + len(inputs) + len(outputs))
    if m.n_states:
        groups.append(("state", len(outputs)))
        outputs += _variables("state", m.signals["state"], "output", "discrete", 1 + len(inputs) + len(outputs))
    what = "0, or the bits 1 displacement, 2 composite limit, 4 state, 8 drive limit, 16 unusable input, 32 lost state"
    what += ", 128 rate of a drive" if controller.rate else ""
    status = Variable(1 + len(inputs) + len(outputs), "status", "output", "discrete", what, {}, "Int32")
    return _Unit(
        "controller",
        core,
        f"online controller of {m.device.title}",
        inputs,
        outputs,
        status,
        _settled(status.reference + 1, "the first target"),
        {
            "groups": groups,
            "n": len(m.axes),
            "nu": m.u.numel(),
            "n_s": m.n_states,
            "drive_start": [Real.DOUBLE.literal(v) for v in controller.kernels.safe_drive],
            "rated": controller.rate is not None,
            "estimated": controller.kernels.contraction is not None,
            "ringing": controller.kernels.ringing is not None,
            "most_settling": controller.rate.samples(*m.u_bounds) if controller.rate else 0,
        },
    )


def _plant_unit(scenario: Scenario, plant: Plant, folder: Path) -> _Unit:
    """The plant's C in `folder`, and the unit around it."""
    m, core = plant.model, write_plant(scenario, plant, Real.DOUBLE, folder)
    inputs = _variables("drive", m.signals["drive"], "input", "discrete", 1, np.clip(0.0, *m.u_bounds))
    outputs: list[Variable] = []
    groups = []
    for role, signal in m.signals.items():
        if role != "drive":
            groups.append((signal.name, len(outputs)))
            outputs += _variables(role, signal, "output", "continuous", 1 + len(inputs) + len(outputs))
    settles = None if plant.inertial else _settled(1 + len(inputs) + len(outputs), "the first drives")
    return _Unit("plant", core, m.device.title, inputs, outputs, None, settles, {"groups": groups})


def _settled(reference: int, where: str) -> Variable:
    what = f"start in the equilibrium at {where} instead of cold and at rest"
    return Variable(reference, "start_settled", "parameter", "fixed", what, {"start": "false"}, "Boolean")


def _variables(
    role: str,
    signal: Any,
    causality: str,
    variability: str,
    first: int,
    start: np.ndarray | None = None,
    bounds: tuple[np.ndarray, np.ndarray] | None = None,
) -> list[Variable]:
    """One variable a channel of `signal`, in SI, with its reader's unit to display it in."""
    variables = []
    for k, (channel, unit, scale) in enumerate(zip(signal.channels, signal.units, signal.scale, strict=True)):
        attributes = {"unit": base_unit(unit)}
        if unit != attributes["unit"]:
            attributes["displayUnit"] = unit
        if bounds is not None:
            attributes |= {
                n: repr(float(b[k])) for n, b in zip(("min", "max"), bounds, strict=True) if np.isfinite(b[k])
            }
        attributes["nominal"] = repr(float(scale))
        if start is not None:
            attributes["start"] = repr(float(start[k]))
        variables.append(
            Variable(first + k, f"{role}_{channel}", causality, variability, f"{signal.label} {channel}", attributes)
        )
    return variables


def _units(variables: list[Variable]) -> list[FmiUnit]:
    """Definitions of all units that `variables` are in or displayed in."""
    seen: dict[str, dict[str, None]] = {"s": {}}
    for v in variables:
        if "unit" in v.attributes:
            shown = seen.setdefault(v.attributes["unit"], {})
            if "displayUnit" in v.attributes:
                shown[v.attributes["displayUnit"]] = None

    def displayed(unit: str) -> tuple[str, str, str]:
        zero = float(from_si(0.0, unit))
        return unit, repr(float(from_si(1.0, unit)) - zero), repr(zero)

    return [FmiUnit(name, exponents(name), tuple(map(displayed, shown))) for name, shown in seen.items()]


def _platform(fmi: int) -> tuple[str, str]:
    """This computer's folder of binaries and the ending of a shared library. Raises CtrlgenError for one FMI has no name for."""
    if sys.platform not in SYSTEMS:
        raise CtrlgenError(f"FMI has no name for the platform {sys.platform}; build the FMU's sources there yourself")
    system, ending = SYSTEMS[sys.platform]
    machine = platform.machine().lower()
    if fmi == 2:
        return ("win" if system == "windows" else system) + ("64" if sys.maxsize > 2**32 else "32"), ending
    return f"{MACHINES.get(machine, machine)}-{system}", ending


def _write_unit(
    scenario: Scenario, plant: Plant, unit: _Unit, fmi: int, folder: Path, compiler: str | None, out: Path
) -> str:
    """The FMU of `unit`, whose C is in `folder`, in the folder `out`; its file's name."""
    identifier = f"{scenario.name}_{unit.kind}"
    core = {f"{unit.core}.{end}": (folder / f"{unit.core}.{end}").read_bytes() for end in ("c", "h")}
    identity = repr((__version__, fmi, sorted(scenario.digest.items()))).encode()
    digest = hashlib.sha256(identity + b"".join(core.values())).hexdigest()
    sources = [f"{identifier}.c", f"{unit.core}.c"]
    context = unit.more | {
        "identifier": identifier,
        "fmi": f"{fmi}.0",
        "real": Real.DOUBLE,
        "core": unit.core,
        "title": unit.title,
        "unit": unit.kind,
        "digest": scenario.digest,
        "version": __version__,
        "program": program(),
        "sources": sources,
        "sample_time": repr(plant.sample_time),
        "token": f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}",
        "inputs": unit.inputs,
        "outputs": unit.outputs,
        "status": unit.status,
        "settles": unit.settles,
        "initial_inputs": [v.attributes["start"] for v in unit.inputs],
        "variables": unit.variables,
        "units": _units(unit.variables),
        "stop_time": repr(len(scenario.bind(plant.model).samples) * plant.sample_time),
        "description": _described(scenario, unit),
        "foreign_types": FOREIGN_TYPES,
        "refused": REFUSED_3 if fmi == 3 else REFUSED_2,
    }
    write(f"fmi{fmi}.c", context, folder / f"{identifier}.c")
    write(f"modelDescription{fmi}.xml", context, folder / "modelDescription.xml")
    files = {
        "modelDescription.xml": (folder / "modelDescription.xml").read_bytes(),
        f"sources/{identifier}.c": (folder / f"{identifier}.c").read_bytes(),
    } | {f"sources/{name}": content for name, content in core.items()}
    if fmi == 3:
        write("buildDescription.xml", context, folder / "buildDescription.xml")
        files["sources/buildDescription.xml"] = (folder / "buildDescription.xml").read_bytes()
    if compiler is not None:
        name, ending = _platform(fmi)
        binary = folder / f"{identifier}{ending}"
        words = ["-shared", "-fvisibility=hidden", *([] if ending == ".dll" else ["-fPIC"])]
        words += ["-s"] if ending == ".so" else []  # names of scratch folders would tell one build from the next
        compile_c(compiler, folder, [*words, *(str(folder / source) for source in sources), "-o", str(binary)])
        files[f"binaries/{name}/{binary.name}"] = binary.read_bytes()
    write_bytes(out / f"{identifier}.fmu", _zipped(files))
    return f"{identifier}.fmu"


def _described(scenario: Scenario, unit: _Unit) -> str:
    made = f"device {scenario.digest['device'][:16]}, scenario {scenario.digest['scenario'][:16]} (sha256)"
    return f"{unit.title}, for: {scenario.file.title}. Made from {made}"


def _zipped(files: dict[str, bytes]) -> bytes:
    """A ZIP of `files` by path that depends on nothing else."""
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w") as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, ZIP_TIME)
            entry.create_system, entry.external_attr = 3, 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, files[name])
    return memory.getvalue()
