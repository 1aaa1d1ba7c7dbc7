"""Inertial unit, wheel odometry and cameras: truth in, measurements out."""
