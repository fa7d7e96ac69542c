"""One function as C, without the file around it."""

from __future__ import annotations

import casadi as ca

from ctrlgen.firmware.c.cprint import Kernel, Printer, Ranges
from ctrlgen.firmware.c.real import Real


def print_function(function: ca.Function, name: str, real: Real, ranges: Ranges | None = None) -> Kernel:
    """`function` (SX, dense arguments, one result) as a static C function whose result may be an argument too."""
    return Printer(real, ranges or {}).kernel(function, name, may_be_result=function.name_in())
