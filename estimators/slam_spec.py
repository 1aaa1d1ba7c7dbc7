"""The variants of the SLAM filter as data: who enters the state, who leaves, and how errors add."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from lpet_sim.spec import Spec

UNLIMITED = 9999
"""Reads as "no limit" in run names, as in the paper's."""


class KeepAll(Spec):
    """Full SLAM: every landmark enters when it is first seen, and stays."""

    kind: Literal["keep_all"] = "keep_all"

    @property
    def label(self) -> str:
        """How run names tell it."""
        return f"m{UNLIMITED}-n{UNLIMITED}"


class TimeToLive(Spec):
    """Multiframe: every landmark enters when it is first seen, and leaves some images after.

    Attributes:
        images: The counter M, set whenever the landmark is seen and lowered by one for each image
            in which it is not; at 0 the landmark leaves.
    """

    kind: Literal["time_to_live"] = "time_to_live"
    images: Annotated[int, Field(ge=1)] = 10

    @property
    def label(self) -> str:
        """How run names tell it."""
        return f"m{self.images}-n{UNLIMITED}"


class BoundedQueue(Spec):
    """Bounded state: a landmark waits outside until it is seen again, and the queue holds N.

    Attributes:
        size: Most landmarks in the queue, N.
        leave: Who leaves a full queue for the next: the one that came first, the one with the
            shortest time to live (unseen for longest), or the one whose sighting is predicted least
            surely.
        waiting_images: Images after which one that waits unseen is forgotten.
    """

    kind: Literal["bounded_queue"] = "bounded_queue"
    size: Annotated[int, Field(ge=1)] = 40
    leave: Literal["first_in_first_out", "shortest_time_to_live", "least_confidence"] = (
        "first_in_first_out"
    )
    waiting_images: Annotated[int, Field(ge=1)] = 10

    @property
    def label(self) -> str:
        """How run names tell it."""
        short = {"first_in_first_out": "fifo", "shortest_time_to_live": "ttl"}
        return f"m{UNLIMITED}-n{self.size}-{short.get(self.leave, 'conf')}"


Retention = Annotated[KeepAll | TimeToLive | BoundedQueue, Field(discriminator="kind")]


class AnchorSpec(Spec):
    """Landmarks mapped while the rover stands at the start, which tie the map to the world.

    Attributes:
        count_max: Most anchors.
        looks_min: Fewest sightings at standstill that make a landmark an anchor.
        prefer: Which ones are chosen if there are more: the farthest, which stay in view, or those
            known best by the size of their disparity, the nearest.
        unseen_images_max: An anchor unseen for longer leaves like any other landmark; None: never.
        standstill_m: The rover stands while an image's step by odometry is at most this long [m].
        standstill_rad: And turns it by at most this [rad].
        settling_images: Images of motion at the start, such as of settling, after which no more
            standstill is waited for.
    """

    count_max: Annotated[int, Field(ge=1)] = 30
    looks_min: Annotated[int, Field(ge=2)] = 10
    prefer: Literal["far", "near"] = "far"
    unseen_images_max: Annotated[int, Field(ge=1)] | None = None
    standstill_m: Annotated[float, Field(gt=0.0)] = 0.001
    standstill_rad: Annotated[float, Field(gt=0.0)] = 0.001
    settling_images: Annotated[int, Field(ge=0)] = 20


class SlamSpec(Spec):
    """One EKF-SLAM filter; the paper's algorithms are values of these fields.

    Attributes:
        retention: Who enters and who leaves: `KeepAll`, `TimeToLive` or `BoundedQueue`.
        coupling: ``coupled`` keeps the full covariance; ``decoupled`` drops all correlations but
            those within the vehicle (pose and odometry's lasting errors) and within each landmark
            after every update;
            ``decoupled_pose_kept`` drops those between landmarks alone.
        anchors: Pins landmarks mapped at standstill (the paper's observable form); None does not.
        formulation: ``standard`` linearises at the latest estimate, ``first_estimates`` at the
            first one of each pose and landmark, ``right_invariant`` takes errors in the world, with
            one rotation for pose and map.
        landmark_frame: ``world``: landmarks stand in the world, as in the paper; ``keyframe``: they
            are held by their image coordinates in past camera poses, which are part of the state.
            The latter goes with ``right_invariant`` alone, and is taken for it if None.
        keyframe_m: A new keyframe is made for landmarks that enter further than this from the last
            one [m].
        keyframe_rad: Or turned by more [rad].
        association_check: Beside the gate of each sighting: ``none``, or ``one_point_ransac``.
        gate_probability: Share of fitting sightings that pass their chi-square gate.
        sightings_min: An image with fewer accepted sightings counts as bridged by odometry.
        sightings_max: At most this many sightings of an image are taken, spread over it: an image
            costs the cube of their number, and the square of the landmarks' that stay.
        far_disparity_sigmas: A landmark whose disparity is below this many of its standard
            deviations when it enters is far: it is held as image coordinates, not as a place.
        misfits_max: A landmark leaves after this many sightings in a row that do not fit.
        slip_probability: Where the sightings that agree with one another contradict odometry by
            what it would do less often than this, the wheels have slipped: the steps since the last
            image that fitted are then believed to within their own length only. 0 believes them.
        slip_rounds: Times that the sightings are then linearised anew.
        slip_sigma_m: Least error of such a step [m].
        slip_sigma_rad: Likewise of its rotation [rad].
        free_sigma_m: Error of a step for which there is no odometry, along each axis; it is held to
            be the last one [m].
        free_sigma_rad: Likewise of its rotation [rad].
        noise_scale: Factor on the declared noise of sightings and odometry, 1 sigma; for tests of
            what a filter makes of wrong noise.
    """

    retention: Retention = TimeToLive()
    coupling: Literal["coupled", "decoupled", "decoupled_pose_kept"] = "coupled"
    anchors: AnchorSpec | None = None
    formulation: Literal["standard", "first_estimates", "right_invariant"] = "right_invariant"
    landmark_frame: Literal["world", "keyframe"] = "keyframe"
    keyframe_m: Annotated[float, Field(gt=0.0)] = 1.0
    keyframe_rad: Annotated[float, Field(gt=0.0)] = 0.2
    association_check: Literal["none", "one_point_ransac"] = "one_point_ransac"
    gate_probability: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.999
    sightings_min: Annotated[int, Field(ge=1)] = 3
    sightings_max: Annotated[int, Field(ge=1)] = 120
    far_disparity_sigmas: Annotated[float, Field(ge=0.0)] = 5.0
    misfits_max: Annotated[int, Field(ge=1)] = 3
    slip_probability: Annotated[float, Field(ge=0.0, lt=1.0)] = 1e-6
    slip_rounds: Annotated[int, Field(ge=0)] = 4
    slip_sigma_m: Annotated[float, Field(gt=0.0)] = 0.01
    slip_sigma_rad: Annotated[float, Field(gt=0.0)] = 0.005
    free_sigma_m: Annotated[float, Field(gt=0.0)] = 0.3
    free_sigma_rad: Annotated[float, Field(gt=0.0)] = 0.03
    noise_scale: Annotated[float, Field(gt=0.0)] = 1.0

    @model_validator(mode="before")
    @classmethod
    def _usual_frame(cls, values: object) -> object:
        """Take the landmark frame that goes with the formulation where none is given."""
        if not isinstance(values, dict) or values.get("landmark_frame") is not None:
            return values
        invariant = values.get("formulation", "right_invariant") == "right_invariant"
        return values | {"landmark_frame": "keyframe" if invariant else "world"}

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if self.coupling != "coupled" and self.formulation == "right_invariant":
            raise ValueError(
                "a decoupled filter drops correlations of errors in world coordinates: its "
                "formulation must be standard or first_estimates"
            )
        if self.landmark_frame == "keyframe" and self.formulation != "right_invariant":
            raise ValueError(
                f"landmarks of a {self.formulation} filter stand in the world: landmark_frame "
                "must be world, or formulation right_invariant"
            )
        return self

    @property
    def label(self) -> str:
        """How run names tell the variant, such as ``m10-n9999-coupled-observable-invariant``."""
        observable = "unobservable" if self.anchors is None else "observable"
        form = {"standard": "standard", "first_estimates": "fej"}.get(self.formulation, "invariant")
        form += "_world" if form == "invariant" and self.landmark_frame == "world" else ""
        return f"{self.retention.label}-{self.coupling}-{observable}-{form}"
