"""Parameters of the GTSAM peers; where nothing else is said they are this project's choice."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from lpet_sim.spec import Spec

Positive = Annotated[float, Field(gt=0.0)]


class PeerSpec(Spec):
    """What both peers have in common.

    Attributes:
        robust: Kernel on the whitened residual of a sighting, ``none`` for Gaussian noise.
        robust_width: Where the kernel takes effect, in standard deviations of the residual's norm,
            whose RMS is the root of 3.
        disparity_sigmas_min: A landmark enters with a sighting whose disparity is more than this
            many of its standard deviations, ``sigma_px sqrt(2)``; those of nearly no or of negative
            disparity have no point to start from. Once it is in, all its sightings count.
        landmark_sigma_m: Weak prior of each landmark at the point where it enters [m]. Without it
            one that false sightings put behind a camera, where GTSAM's factor has no derivative,
            would make the system singular.
        covariances: Of which poses the covariance is asked for; where it is not, rows hold NaN.
            ``none`` leaves it out of the estimate, and its cost out of the time.
        prior_sigma_m: Of the given start [m]; GTSAM wants a number.
        prior_sigma_rad: Likewise [rad].
    """

    robust: Literal["none", "huber", "geman_mcclure"] = "none"
    robust_width: Positive = 3.0
    disparity_sigmas_min: Annotated[float, Field(ge=0.0)] = 5.0
    landmark_sigma_m: Positive = 1000.0
    covariances: Literal["every_image", "last_image", "none"] = "every_image"
    prior_sigma_m: Positive = 1e-6
    prior_sigma_rad: Positive = 1e-6


class GtsamFixedLagSpec(PeerSpec):
    """Parameters of the incremental fixed-lag smoother.

    Attributes:
        lag_images: Poses and landmarks last seen longer ago than this are marginalised out; the
            window holds one pose more.
        relinearize_threshold: Largest change of a variable that is left at its old linearisation
            [m, rad]; GTSAM's own default is 0.1.
        extra_iterations: Updates after the one that brings an image's factors.
        factorization: How cliques are eliminated.
    """

    lag_images: Annotated[int, Field(ge=1)] = 10
    relinearize_threshold: Annotated[float, Field(ge=0.0)] = 0.01
    extra_iterations: Annotated[int, Field(ge=0)] = 0
    factorization: Literal["cholesky", "qr"] = "cholesky"


class GtsamBatchSpec(PeerSpec):
    """Parameters of the batch solution.

    Attributes:
        method: How the least squares are solved.
        iterations_max: Most iterations.
        tolerance: It ends where an iteration lowers the error by less, relative to the error.
    """

    method: Literal["levenberg_marquardt", "gauss_newton", "dogleg"] = "levenberg_marquardt"
    iterations_max: Annotated[int, Field(ge=1)] = 100
    tolerance: Positive = 1e-8
