"""What the landmark-level sensor is: sightings of a traverse without images."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from lpet_sim.spec import Spec

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Density = Annotated[float, Field(ge=0.0, le=10.0)]


class LandmarkFieldSpec(Spec):
    """Where landmarks are: strewn on the ground, on rocks, and on far relief.

    The defaults are choices: with those of `LandmarkSensorSpec` they give about 40 sightings an
    image on the ExoMars terrain (the paper), a quarter of them far.

    Attributes:
        ground_per_m2: Landmarks on the ground [1/m^2]; those under rocks are never seen.
        per_rock: Mean number of landmarks on a rock (Poisson).
        rock_min_diameter_m: Smaller rocks carry none and hide nothing [m].
        far_per_rad: Landmarks on far relief and the skyline for each radian of bearing [1/rad].
        far_from_m: Relief is far from here on [m].
    """

    ground_per_m2: Density = 3.0
    per_rock: Density = 2.5
    rock_min_diameter_m: Positive = 0.1
    far_per_rad: NotNegative = 12.0
    far_from_m: Positive = 60.0


class VisibilitySpec(Spec):
    """Which landmarks a pair of images shows.

    Attributes:
        border_px: Landmarks nearer to an image's edge are not seen.
        range_min_m: Nearer landmarks are not seen [m].
        range_max_m: Landmarks on ground and rocks further than this are not seen [m].
        range_full_m: Up to this range all of them are seen [m].
        range_exponent: Beyond it each is seen up to a range of its own, drawn once for it: the
            share still seen at range r is ``(range_full_m / r)^range_exponent``. What covers a
            plane in all sizes alike, and is seen while it covers enough pixels, has 2, and covers
            an image evenly; half of the SIFT sightings of a rendered ExoMars traverse are nearer
            than 4 m. 0: all are seen up to `range_max_m`.
        incidence_max_rad: Angle between the line of sight and the surface's normal up to which a
            landmark on ground or rock is seen [rad].
        occlusion: Whether ground and rocks hide what lies behind them.
        sightings_max: At most this many landmarks of an image are shown to the front end, those of
            the greatest strength, which is drawn once for each landmark; None: all. Detection
            comes after it, so that it changes nobody else's chance.
    """

    border_px: NotNegative = 8.0
    range_min_m: Positive = 0.8
    range_max_m: Positive = 20.0
    range_full_m: Positive = 2.0
    range_exponent: NotNegative = 2.0
    incidence_max_rad: Annotated[float, Field(gt=0.0, le=math.pi / 2)] = math.radians(86.0)
    occlusion: bool = True
    sightings_max: Annotated[int, Field(ge=1)] | None = 60


class SightingNoiseSpec(Spec):
    """What is wrong with the image coordinates of a landmark.

    Attributes:
        sigma_left_px: White noise of u in the left image, 1 sigma.
        sigma_right_px: White noise of u in the right image, independent of the left's, 1 sigma.
        sigma_v_px: White noise of v, 1 sigma.
        bias_sigma_px: Fixed error of each coordinate of a landmark, drawn once for it, 1 sigma.
        resolution_px: Coordinates are rounded to multiples of this; 0: not at all.
        declared_sigma_px: What an estimator is told of the noise; None: the root mean square of the
            three white ones, or the calibration's where they are all 0.
        drift_px: Random walk of what stands for a landmark in the images, with the distance driven,
            1 sigma of each coordinate, root mean square over landmarks [px/sqrt(m)]; 0: tracks do
            not slide. docs/slam.md has what rendered images show.
        drift_spread: Standard deviation of the logarithm of a landmark's own drift, drawn once for
            it; 0: all slide alike.
        declared_drift_px: What an estimator is told of it [px/sqrt(m)]; None: the true one.
    """

    sigma_left_px: NotNegative = 0.5
    sigma_right_px: NotNegative = 0.5
    sigma_v_px: NotNegative = 0.5
    bias_sigma_px: NotNegative = 0.0
    resolution_px: NotNegative = 0.0
    declared_sigma_px: Positive | None = None
    drift_px: NotNegative = 0.0
    drift_spread: Annotated[float, Field(ge=0.0, le=3.0)] = 0.0
    declared_drift_px: NotNegative | None = None


class LandmarkSensorSpec(Spec):
    """A stereo camera with its front end as a statistical sensor of landmarks.

    The recording's declared calibration says where the camera is and how it sees; the scale errors
    say by how much the truth is off it, as in `DeclaredErrorSpec`: declared over true, less 1.

    Attributes:
        period_s: Time between image pairs [s]; 0.72 s is 2 cm at 100 m/h (the paper).
        field: Where landmarks are.
        visibility: Which of them an image shows.
        noise: What is wrong with their coordinates.
        detection_probability: Share of the shown landmarks that a front end finds, drawn anew for
            each image.
        loss_probability: Chance that a front end loses a shown landmark for good from one of its
            images to the next: from then on it is another one, with a new name and its own drift.
        misclassification_probability: Share of the sightings that carry the name of another
            landmark shown in the same image.
        disparity_bias_px: Bias of every measured disparity ``u_left - u_right`` [px].
        focal_scale_error: Declared over true focal length, less 1.
        baseline_scale_error: Declared over true baseline, less 1.
    """

    period_s: Positive = 0.72
    field: LandmarkFieldSpec = LandmarkFieldSpec()
    visibility: VisibilitySpec = VisibilitySpec()
    noise: SightingNoiseSpec = SightingNoiseSpec()
    detection_probability: Share = 0.8
    loss_probability: Share = 0.0
    misclassification_probability: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.0
    disparity_bias_px: float = 0.0
    focal_scale_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
    baseline_scale_error: Annotated[float, Field(gt=-0.5, lt=0.5)] = 0.0
