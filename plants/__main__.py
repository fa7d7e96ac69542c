"""Prints what the independent models answer beside S1: stage forces (Fig. 13), coupled poses (Table 3), the circle."""

from __future__ import annotations

import argparse

import numpy as np

from plants.cases import CIRCLE, COUPLED, PARASITIC, circle, coupled_poses
from plants.mems_hexapod import MemsHexapod
from plants.numbers import read
from plants.paper import error, linear_force, nonlinear_force
from plants.xy_stage import Options, Stage, actuator_stiffness


def main() -> None:
    """The three tables, in some ten seconds."""
    argparse.ArgumentParser(prog="python -m plants", description=__doc__).parse_args()
    stage_forces()
    plant = MemsHexapod()
    print("\nSix coupled poses at delta_z = 30 um (S1 Table 3): forces of ctrlgen, error by S1 eq. (20)")
    print("            commanded     plant  error   printed")
    case = coupled_poses(plant)
    for k, ((name, printed), ours) in enumerate(zip(COUPLED, case.coupled_errors().values(), strict=True)):
        i, unit, scale = _channel(name)
        values = case.command[k, i] * scale, case.reached[k, i] * scale
        print(f"{name}  {values[0]:8.1f} {unit}  {values[1]:8.3f}  {ours:4.2f} %  {printed:4.2f} %")
    print("\nCircle of 20 um at delta_z = 20 um (S1 section 6.3): forces of ctrlgen")
    case = circle(plant)
    errors = case.mean_errors()
    for name, printed in CIRCLE.items():
        print(f"mean error {name}      {errors[name]:4.2f} %      printed {printed:4.2f} %")
    mean, printed_mean = (float(np.mean(list(values.values()))) for values in (errors, CIRCLE))
    print(f"mean of the three       {mean:4.2f} %      printed {printed_mean:4.2f} %")
    for (name, ours), printed in zip(case.parasitic().items(), PARASITIC.values(), strict=True):
        print(f"mean parasitic {name}  {ours:.3e} rad  printed {printed:.3e} rad")


def _channel(name: str) -> tuple[int, str, float]:
    """Place of a channel in the pose, the unit shown, and how many of it make one of ours."""
    turns = name.startswith("theta")
    place = "xyz".index(name[-1])
    return (place, "mrad", 1e3) if turns else (3 + place, "um  ", 1.0)


def stage_forces() -> None:
    """Displacement against force of one stage axis to 55 um and the errors of S1's two laws, for both shapes of the arms."""
    numbers = read()
    s, K_t14 = numbers.stage, float(actuator_stiffness(numbers.actuator)[0, 0])
    stages = [Stage(numbers), Stage(numbers, Options(arm="z"))]
    print("d [um]   linear [N]  nonlinear [N]  plant [N]  plant, Z arms [N]")
    starts: list = [None, None]
    for d in np.arange(5.0, 56.0, 5.0):
        forces = []
        for k, stage in enumerate(stages):
            force, starts[k] = stage.force_for(float(d), starts[k])
            forces.append(force)
        laws = linear_force(d, s, K_t14), nonlinear_force(d, s, K_t14)
        print(f"{d:6.0f}   {laws[0]:.6f}    {laws[1]:.6f}       {forces[0]:.6f}   {forces[1]:.6f}")
    command = np.arange(0.5, 55.1, 0.5)
    for name, law in (("nonlinear", nonlinear_force), ("linear", linear_force)):
        reached = [stages[0].displacement(state) for state in stages[0].path(law(command, s, K_t14))]
        e = error(command, np.array(reached))
        print(f"{name:9} law: mean error {e.mean():.2f} %, {e[0]:.2f} % at the beginning, {e[-1]:.2f} % at 55 um")


if __name__ == "__main__":
    main()
