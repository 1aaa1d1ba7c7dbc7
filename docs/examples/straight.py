"""Drives straight on along the first heading, by the mean of all wheels."""

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.trajectory import Trajectory


class Straight:
    name = "straight"
    needs = ("wheels",)

    def __init__(self, scale=1.0):
        self.scale = scale

    def estimate(self, measurements):
        wheels, declared = measurements.wheels, measurements.calibration
        turned = wheels.drive_angle_rad.mean(axis=1)
        way = np.zeros((len(turned), 3))
        way[:, 0] = self.scale * declared.wheels.radius_m * (turned - turned[0])
        level = SE3(np.tile(np.eye(3), (len(turned), 1, 1)), way)
        poses = declared.T_world_body_start.se3() @ level
        return Estimate(self.name, Trajectory(wheels.t_ns.copy(), poses))
