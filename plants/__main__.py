"""Prints displacement against force of one stage axis, and the error of the paper's two laws (S1 Fig. 13)."""

from __future__ import annotations

import numpy as np

from plants.numbers import read
from plants.paper import error, linear_force, nonlinear_force
from plants.xy_stage import Options, Stage, actuator_stiffness


def main() -> None:
    """The force table to 55 um and the errors by S1 eq. (20), for both shapes of the arms."""
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
