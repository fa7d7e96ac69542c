"""Calls of the FMI standards that a co-simulation unit of ctrlgen has no use for: they must exist, and refuse.

They stand as in C, without the instance, which is their first parameter; the types are those of the standards' platform types. The
standards' own headers are not copied.
"""

from __future__ import annotations

import re

Calls = tuple[tuple[str, tuple[tuple[str, str], ...]], ...]


def _calls(declarations: str) -> Calls:
    """Name and parameters, (C type, name), of each declaration."""
    parameter = re.compile(r"(.*?)(\w+(?:\[\])?)(?:,\s+|$)")
    return tuple(
        (name, tuple(parameter.findall(given))) for name, given in re.findall(r"(\w+)\(([^)]*)\)", declarations)
    )


# Name and C type of the variables of other types than the units have.
FOREIGN_TYPES = (
    ("Float32", "float "),
    ("Int8", "int8_t "),
    ("UInt8", "uint8_t "),
    ("Int16", "int16_t "),
    ("UInt16", "uint16_t "),
    ("UInt32", "uint32_t "),
    ("Int64", "int64_t "),
    ("UInt64", "uint64_t "),
    ("String", "const char *"),
    ("Clock", "bool "),
)

REFUSED_3 = _calls("""
GetBinary(const fmi3ValueReference references[], size_t count, size_t sizes[], const uint8_t *values[], size_t size)
SetBinary(const fmi3ValueReference references[], size_t count, const size_t sizes[], const uint8_t *const values[], size_t size)
GetNumberOfVariableDependencies(fmi3ValueReference reference, size_t *count)
GetVariableDependencies(fmi3ValueReference dependent, size_t elements[], fmi3ValueReference independents[],
    size_t independent_elements[], fmi3DependencyKind kinds[], size_t count)
GetDirectionalDerivative(const fmi3ValueReference unknowns[], size_t unknown_count, const fmi3ValueReference knowns[],
    size_t known_count, const double seed[], size_t seed_count, double sensitivity[], size_t sensitivity_count)
GetAdjointDerivative(const fmi3ValueReference unknowns[], size_t unknown_count, const fmi3ValueReference knowns[], size_t known_count,
    const double seed[], size_t seed_count, double sensitivity[], size_t sensitivity_count)
EnterConfigurationMode()
ExitConfigurationMode()
EnterEventMode()
EnterStepMode()
GetIntervalDecimal(const fmi3ValueReference references[], size_t count, double intervals[], fmi3IntervalQualifier qualifiers[])
GetIntervalFraction(const fmi3ValueReference references[], size_t count, uint64_t counters[], uint64_t resolutions[],
    fmi3IntervalQualifier qualifiers[])
GetShiftDecimal(const fmi3ValueReference references[], size_t count, double shifts[])
GetShiftFraction(const fmi3ValueReference references[], size_t count, uint64_t counters[], uint64_t resolutions[])
SetIntervalDecimal(const fmi3ValueReference references[], size_t count, const double intervals[])
SetIntervalFraction(const fmi3ValueReference references[], size_t count, const uint64_t counters[], const uint64_t resolutions[])
SetShiftDecimal(const fmi3ValueReference references[], size_t count, const double shifts[])
SetShiftFraction(const fmi3ValueReference references[], size_t count, const uint64_t counters[], const uint64_t resolutions[])
EvaluateDiscreteStates()
UpdateDiscreteStates(bool *again, bool *terminate, bool *nominals, bool *values, bool *timed, double *next)
EnterContinuousTimeMode()
CompletedIntegratorStep(bool no_return, bool *event, bool *terminate)
SetTime(double time)
SetContinuousStates(const double values[], size_t count)
GetContinuousStateDerivatives(double values[], size_t count)
GetEventIndicators(double values[], size_t count)
GetContinuousStates(double values[], size_t count)
GetNominalsOfContinuousStates(double values[], size_t count)
GetNumberOfEventIndicators(size_t *count)
GetNumberOfContinuousStates(size_t *count)
GetOutputDerivatives(const fmi3ValueReference references[], size_t count, const int32_t orders[], double values[], size_t size)
ActivateModelPartition(fmi3ValueReference clock, double time)
""")

REFUSED_2 = _calls("""
GetString(const fmi2ValueReference references[], size_t count, const char *values[])
SetString(const fmi2ValueReference references[], size_t count, const char *const values[])
SetInteger(const fmi2ValueReference references[], size_t count, const int values[])
GetDirectionalDerivative(const fmi2ValueReference unknowns[], size_t unknown_count, const fmi2ValueReference knowns[],
    size_t known_count, const double seed[], double sensitivity[])
SetRealInputDerivatives(const fmi2ValueReference references[], size_t count, const int orders[], const double values[])
GetRealOutputDerivatives(const fmi2ValueReference references[], size_t count, const int orders[], double values[])
CancelStep()
GetStatus(fmi2StatusKind kind, fmi2Status *value)
GetIntegerStatus(fmi2StatusKind kind, int *value)
GetStringStatus(fmi2StatusKind kind, const char **value)
""")
