"""Test rigs: a rover on a tilt bed and a single wheel, to hold the wheel-soil law to its curves."""
