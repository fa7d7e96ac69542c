"""Calls of the FMI standards that a co-simulation unit of ctrlgen has no use for: they must exist, and refuse.

The parameters after the instance as (C type, name); the types are those of the standards' platform types. The
standards' own headers are not copied.
"""

from __future__ import annotations

Calls = tuple[tuple[str, tuple[tuple[str, str], ...]], ...]

REFERENCES = "const fmi3ValueReference "
FLOATS, SIZE, FLAG = "const double ", "size_t ", "bool *"

FOREIGN_TYPES = (
    ("Float32", "float "), ("Int8", "int8_t "), ("UInt8", "uint8_t "), ("Int16", "int16_t "), ("UInt16", "uint16_t "),
    ("UInt32", "uint32_t "), ("Int64", "int64_t "), ("UInt64", "uint64_t "), ("String", "const char *"), ("Clock", "bool "),
)  # fmt: skip

_ON = ((REFERENCES, "references[]"), (SIZE, "count"))
_DERIVATIVE = (
    (REFERENCES, "unknowns[]"), (SIZE, "unknown_count"), (REFERENCES, "knowns[]"), (SIZE, "known_count"),
    (FLOATS, "seed[]"), (SIZE, "seed_count"), ("double ", "sensitivity[]"), (SIZE, "sensitivity_count"),
)  # fmt: skip
_COUNTED = (*_ON, ("uint64_t ", "counters[]"), ("uint64_t ", "resolutions[]"))
_SET_COUNTED = (*_ON, ("const uint64_t ", "counters[]"), ("const uint64_t ", "resolutions[]"))
_QUALIFIERS = ("fmi3IntervalQualifier ", "qualifiers[]")
_STATES = (("double ", "values[]"), (SIZE, "count"))

REFUSED_3: Calls = (
    ("GetBinary", (*_ON, (SIZE, "sizes[]"), ("const uint8_t *", "values[]"), (SIZE, "size"))),
    ("SetBinary", (*_ON, ("const size_t ", "sizes[]"), ("const uint8_t *const ", "values[]"), (SIZE, "size"))),
    ("GetNumberOfVariableDependencies", (("fmi3ValueReference ", "reference"), ("size_t *", "count"))),
    ("GetVariableDependencies", (
        ("fmi3ValueReference ", "dependent"), (SIZE, "elements[]"), ("fmi3ValueReference ", "independents[]"),
        (SIZE, "independent_elements[]"), ("fmi3DependencyKind ", "kinds[]"), (SIZE, "count"),
    )),
    ("GetDirectionalDerivative", _DERIVATIVE),
    ("GetAdjointDerivative", _DERIVATIVE),
    ("EnterConfigurationMode", ()),
    ("ExitConfigurationMode", ()),
    ("EnterEventMode", ()),
    ("EnterStepMode", ()),
    ("GetIntervalDecimal", (*_ON, ("double ", "intervals[]"), _QUALIFIERS)),
    ("GetIntervalFraction", (*_COUNTED, _QUALIFIERS)),
    ("GetShiftDecimal", (*_ON, ("double ", "shifts[]"))),
    ("GetShiftFraction", _COUNTED),
    ("SetIntervalDecimal", (*_ON, (FLOATS, "intervals[]"))),
    ("SetIntervalFraction", _SET_COUNTED),
    ("SetShiftDecimal", (*_ON, (FLOATS, "shifts[]"))),
    ("SetShiftFraction", _SET_COUNTED),
    ("EvaluateDiscreteStates", ()),
    ("UpdateDiscreteStates", (
        (FLAG, "again"), (FLAG, "terminate"), (FLAG, "nominals"), (FLAG, "values"), (FLAG, "timed"), ("double *", "next"),
    )),
    ("EnterContinuousTimeMode", ()),
    ("CompletedIntegratorStep", (("bool ", "no_return"), (FLAG, "event"), (FLAG, "terminate"))),
    ("SetTime", (("double ", "time"),)),
    ("SetContinuousStates", ((FLOATS, "values[]"), (SIZE, "count"))),
    ("GetContinuousStateDerivatives", _STATES),
    ("GetEventIndicators", _STATES),
    ("GetContinuousStates", _STATES),
    ("GetNominalsOfContinuousStates", _STATES),
    ("GetNumberOfEventIndicators", (("size_t *", "count"),)),
    ("GetNumberOfContinuousStates", (("size_t *", "count"),)),
    ("GetOutputDerivatives", (*_ON, ("const int32_t ", "orders[]"), ("double ", "values[]"), (SIZE, "size"))),
    ("ActivateModelPartition", (("fmi3ValueReference ", "clock"), ("double ", "time"))),
)  # fmt: skip

_ON_2 = (("const fmi2ValueReference ", "references[]"), (SIZE, "count"))

REFUSED_2: Calls = (
    ("GetString", (*_ON_2, ("const char *", "values[]"))),
    ("SetString", (*_ON_2, ("const char *const ", "values[]"))),
    ("SetInteger", (*_ON_2, ("const int ", "values[]"))),
    ("GetDirectionalDerivative", (
        ("const fmi2ValueReference ", "unknowns[]"), (SIZE, "unknown_count"), ("const fmi2ValueReference ", "knowns[]"),
        (SIZE, "known_count"), (FLOATS, "seed[]"), ("double ", "sensitivity[]"),
    )),
    ("SetRealInputDerivatives", (*_ON_2, ("const int ", "orders[]"), (FLOATS, "values[]"))),
    ("GetRealOutputDerivatives", (*_ON_2, ("const int ", "orders[]"), ("double ", "values[]"))),
    ("CancelStep", ()),
    ("GetStatus", (("fmi2StatusKind ", "kind"), ("fmi2Status *", "value"))),
    ("GetIntegerStatus", (("fmi2StatusKind ", "kind"), ("int *", "value"))),
    ("GetStringStatus", (("fmi2StatusKind ", "kind"), ("const char **", "value"))),
)  # fmt: skip
