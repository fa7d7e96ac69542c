"""The equations of the papers, one file per component, symbolic. Nothing here knows a device file.

Order of reading: `screw` and `flexure` (the algebra and the elements), then the parts of the
NIST MEMS hexapod from the heater to the platform: `thermal_actuator`, `xy_stage`, `hexapod`.
`meso_hexapod` is S0's; `circular_hinge` has the equations of S2, `circular_hinge_table` where each holds; S3's stage is
`piezo_stack` and `rrr_stage`.
Arguments named `a`, `s`, `h` are namespaces of SI numbers or CasADi symbols with the names of
the device file's sections.
"""
