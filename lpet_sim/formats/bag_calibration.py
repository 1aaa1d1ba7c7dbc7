"""What a bag of others says of its sensors: projections of the cameras, and where they sit."""

from __future__ import annotations

from typing import Any

from lpet_sim.errors import RecordingError
from lpet_sim.formats import ros_messages as ros
from lpet_sim.formats.mcap_file import Bag
from lpet_sim.formats.rectify import hold_equal
from lpet_sim.formats.topics import TopicsSpec
from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import Calibration, PoseSpec, StereoCalibration

GRAVITY_MPS2 = 9.81


def stated_calibration(bag: Bag, where: TopicsSpec, declared: Calibration | None) -> Calibration:
    """Read the cameras' calibration; noise of an inertial unit and wheels are in no message.

    Args:
        bag: The bag.
        where: Its topics.
        declared: What the user declares; where it has the cameras, the bag is not asked.

    Raises:
        RecordingError: The projections, or the place of the cameras, are not in the bag.
    """
    asked = declared is None or "stereo" not in declared.model_fields_set
    stereo = _stereo(bag, where) if asked and bag.count([where.left_image]) else None
    return Calibration(stereo=stereo, gravity_mps2=GRAVITY_MPS2)


def _stereo(bag: Bag, where: TopicsSpec) -> StereoCalibration:
    left, right = (_first(bag, topic) for topic in (where.left_info, where.right_info))
    if left.p[0] <= 0 or not right.p[3] < left.p[3]:
        raise RecordingError(
            f"{bag.path}: the projections of {where.left_info} and {where.right_info} are not "
            "those of a rectified pair; declare 'stereo' in a YAML file given by --calibration"
        )
    hold_equal(f"{bag.path}, {where.left_info} and {where.right_info}", left.p, right.p)
    frame = _first(bag, where.left_image).header.frame_id
    return StereoCalibration(
        width_px=left.width,
        height_px=left.height,
        focal_px=left.p[0],
        cx_px=left.p[2],
        cy_px=left.p[6],
        baseline_m=(left.p[3] - right.p[3]) / left.p[0],
        T_body_camera=PoseSpec.from_se3(_placed(bag, where, frame)),
    )


def _first(bag: Bag, topic: str) -> Any:
    if not bag.count([topic]):
        raise RecordingError(
            f"{bag.path} has no {topic}; name yours by --topics, or declare 'stereo' in a YAML "
            f"file given by --calibration; it holds {', '.join(sorted(bag.topics))}"
        )
    return next(bag.messages([topic]))[2]


def _placed(bag: Bag, where: TopicsSpec, frame: str) -> SE3:
    """Follow the frames from a sensor's to the body's."""
    parents: dict[str, tuple[str, SE3]] = {}
    for _, _, message in bag.messages([where.tf_static] if bag.count([where.tf_static]) else []):
        for moved in message.transforms:
            parents[moved.child_frame_id] = (moved.header.frame_id, ros.transform_of(moved))
    pose, at = SE3.identity(), frame
    while at != where.body_frame:
        if at not in parents:
            raise RecordingError(
                f"{bag.path}: {where.tf_static} does not lead from the frame '{frame}' to "
                f"'{where.body_frame}'; name the body's frame by --topics, or declare 'stereo' "
                f"in a YAML file given by --calibration; frames are {', '.join(sorted(parents))}"
            )
        at, step = parents.pop(at)
        pose = step @ pose
    return pose
