"""Paths that the rover can drive."""
