"""Parameters of the vision front end."""

from __future__ import annotations

from pydantic import Field

from lpet_sim.spec import Spec


class SiftSpec(Spec):
    """Parameters of the SIFT detector; the defaults are OpenCV's and Lowe's (2004).

    Attributes:
        keypoints_max: Strongest keypoints kept in each eye; 0 keeps all.
        octave_layers: Layers in each octave (Lowe 2004, sec. 3.2).
        contrast_threshold: Least contrast of a keypoint (Lowe 2004, sec. 4, as scaled by OpenCV).
        edge_threshold: Largest ratio of principal curvatures (Lowe 2004, sec. 4.1).
        blur_sigma_px: Blur of the first layer (Lowe 2004, sec. 3.3).
        root: Compare square roots of the descriptors (Arandjelovic and Zisserman 2012).
        white_level_uint16: Grey value that is white in a 16-bit image: 12-bit data by default.
    """

    keypoints_max: int = Field(default=0, ge=0)
    octave_layers: int = Field(default=3, ge=1)
    contrast_threshold: float = Field(default=0.04, gt=0)
    edge_threshold: float = Field(default=10.0, gt=0)
    blur_sigma_px: float = Field(default=1.6, gt=0)
    root: bool = True
    white_level_uint16: int = Field(default=4095, ge=255, le=65535)


class StereoMatchSpec(Spec):
    """Parameters of matching the left eye with the right.

    Attributes:
        epipolar_px: Largest difference of the rows of a match.
        range_min_m: Nearest landmark; it bounds the disparity from above.
        disparity_min_px: Least disparity; landmarks further away are not sighted.
        scale_ratio_max: Largest ratio of the two keypoints' sizes.
        ratio_max: Largest ratio of the distances to the best and the second-best descriptor
            (Lowe 2004, sec. 7.1).
        distance_max: Largest distance of the two descriptors, which are of unit length; within an
            epipolar band there are too few candidates for the ratio alone to tell.
    """

    epipolar_px: float = Field(default=1.5, gt=0)
    range_min_m: float = Field(default=0.7, gt=0)
    disparity_min_px: float = Field(default=0.5, gt=0)
    scale_ratio_max: float = Field(default=1.5, ge=1)
    ratio_max: float = Field(default=0.85, gt=0, le=1)
    distance_max: float = Field(default=0.5, gt=0)


class TemporalMatchSpec(Spec):
    """Parameters of matching over time.

    Attributes:
        time_to_live: Images for which a landmark that is not seen is still looked for.
        search_width: Half the width of the search window, as a share of the image's width.
        search_height: Half the height of the search window, as a share of the image's height.
        scale_ratio_max: Largest ratio of the keypoints' sizes.
        ratio_max: Largest ratio of the distances to the best and second-best descriptor.
        distance_max: Largest distance of the two descriptors, which are of unit length.
        gate_px: Largest distance from where the common motion says that a landmark should be.
        matches_min: Fewest matches with the last image that a common motion is fitted to.
    """

    time_to_live: int = Field(default=10, ge=1)
    search_width: float = Field(default=0.15, gt=0)
    search_height: float = Field(default=0.15, gt=0)
    scale_ratio_max: float = Field(default=1.7, ge=1)
    ratio_max: float = Field(default=0.85, gt=0, le=1)
    distance_max: float = Field(default=0.6, gt=0)
    gate_px: float = Field(default=5.0, gt=0)
    matches_min: int = Field(default=8, ge=3)


class RefineSpec(Spec):
    """Parameters of sub-pixel refinement by aligning patches (Lucas and Kanade 1981).

    The defaults were chosen on rendered ground with rocks, where the truth is known: larger patches
    straddle the edges of rocks and take the disparity of the nearer side.

    Attributes:
        temporal: Align each landmark with its patch in the image where it was first seen.
        half_width_px: A patch spans ``2 half_width_px + 1`` pixels each way.
        iterations_max: Most Gauss-Newton iterations.
        shift_max_px: Largest correction of a keypoint; beyond it the alignment has slid away.
        correlation_min: Least normalised correlation of aligned patches.
        sigma_floor_px: Error of an aligned image coordinate that patch noise does not explain.
        sigma_keypoint_px: Error of a bare SIFT keypoint, where there is no patch to align.
        drift_px: Random walk of what a track stands for, with the distance driven [px/sqrt(m)]:
            edges of rocks against the ground behind them, patches seen from a new side.
    """

    temporal: bool = True
    half_width_px: int = Field(default=4, ge=2, le=20)
    iterations_max: int = Field(default=12, ge=1)
    shift_max_px: float = Field(default=1.0, gt=0)
    correlation_min: float = Field(default=0.9, gt=0, lt=1)
    sigma_floor_px: float = Field(default=0.1, gt=0)
    sigma_keypoint_px: float = Field(default=0.5, gt=0)
    drift_px: float = Field(default=0.3, ge=0)


class FrontEndSpec(Spec):
    """Parameters of the vision front end; they never hold a seed, for it draws no random numbers.

    Attributes:
        sift: Detection.
        stereo: Matching the left eye with the right.
        temporal: Matching over time.
        refine: Sub-pixel refinement.
        sightings_max: Most sightings of an image, spread over the image; 0 keeps all.
    """

    sift: SiftSpec = SiftSpec()
    stereo: StereoMatchSpec = StereoMatchSpec()
    temporal: TemporalMatchSpec = TemporalMatchSpec()
    refine: RefineSpec = RefineSpec()
    sightings_max: int = Field(default=400, ge=0)
