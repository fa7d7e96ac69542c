"""The equations of the papers, symbolic, one file per component; independent of device files.

`screw` and `flexure` hold the algebra and the elements. The MEMS hexapod of S1, from the heater to the platform:
`thermal_actuator`, `xy_stage`, `hexapod`. S0: `meso_hexapod`. S2: `circular_hinge`, with the range of each equation in
`circular_hinge_table`; `sensor_models`. S3: `piezo_stack`, `rrr_stage`. `reference_models` are independent of all these.
Arguments named `a`, `s`, `h` are namespaces of SI numbers or CasADi symbols with the names of the device file's sections.
"""
