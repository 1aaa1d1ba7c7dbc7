"""Sensor trade-off: a static look at the whole space, then simulation of what survives."""
