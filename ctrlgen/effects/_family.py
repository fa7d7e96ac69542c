"""Families of laws: what the residual of a law is like, whichever of the family it is."""

from __future__ import annotations

from enum import Enum


class Family(Enum):
    """Families of laws, as the report names them."""

    FRICTION = "dry friction"
    HYSTERESIS = "hysteresis"
    ELASTIC = "elastic nonlinearity"
    DRIVE = "drive nonlinearity"
    GAIN = "gain and offset"
    CROSS_TALK = "cross-talk"
    DYNAMICS = "dynamics"
    CREEP = "creep"
    TIMING = "timing"
    GEOMETRY = "sensor geometry"
    PERIODIC = "periodic sensor error"
    THERMAL = "thermal"
    EVENTS = "events and disturbances"
