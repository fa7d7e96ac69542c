"""Mechanisms of rigid bodies and flexures, described part by part: `mechanism` is the kind of device, the rest its parts."""
