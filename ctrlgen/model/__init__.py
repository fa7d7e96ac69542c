"""The symbolic model of a device and its uses: assembly, one sample, simulation, inverse, feedforward controller,
linearisation, virtual sensors."""
