"""Independent, geometrically nonlinear models of the devices: what a bench would answer.

Nothing here imports ctrlgen; the two share the numbers in `scenarios/devices/` and no code. The
equilibria are found by Exudyn (geometrically exact beams, finite rotations). Units inside: um, N, rad,
s, W, degC, so that stresses are N/um^2 (1e-6 N/um^2 = 1 MPa).
"""
