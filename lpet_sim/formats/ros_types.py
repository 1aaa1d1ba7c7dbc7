"""The ROS 2 message types that a bag of ours holds, as text for its schemas.

Field names, types and order are the interface that every ROS 2 release shares; the text is ours.

Reference:
    ROS 2 common interfaces: packages std_msgs, geometry_msgs, sensor_msgs, nav_msgs, tf2_msgs.
"""

from __future__ import annotations

IMAGE, CAMERA_INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
IMU, JOINT_STATE = "sensor_msgs/msg/Imu", "sensor_msgs/msg/JointState"
ODOMETRY, TRANSFORMS = "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
NUMBERS, TEXT = "std_msgs/msg/Float64MultiArray", "std_msgs/msg/String"

_FIELDS: dict[str, str] = {
    "builtin_interfaces/Time": "int32 sec; uint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp; string frame_id",
    "std_msgs/String": "string data",
    "std_msgs/MultiArrayDimension": "string label; uint32 size; uint32 stride",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim; uint32 data_offset",
    "std_msgs/Float64MultiArray": "std_msgs/MultiArrayLayout layout; float64[] data",
    "geometry_msgs/Vector3": "float64 x; float64 y; float64 z",
    "geometry_msgs/Point": "float64 x; float64 y; float64 z",
    "geometry_msgs/Quaternion": "float64 x 0; float64 y 0; float64 z 0; float64 w 1",
    "geometry_msgs/Pose": ("geometry_msgs/Point position; geometry_msgs/Quaternion orientation"),
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose; float64[36] covariance",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear; geometry_msgs/Vector3 angular",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist; float64[36] covariance",
    "geometry_msgs/Transform": (
        "geometry_msgs/Vector3 translation; geometry_msgs/Quaternion rotation"
    ),
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header; string child_frame_id; geometry_msgs/Transform transform"
    ),
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "sensor_msgs/Image": (
        "std_msgs/Header header; uint32 height; uint32 width; string encoding; "
        "uint8 is_bigendian; uint32 step; uint8[] data"
    ),
    "sensor_msgs/RegionOfInterest": (
        "uint32 x_offset; uint32 y_offset; uint32 height; uint32 width; bool do_rectify"
    ),
    "sensor_msgs/CameraInfo": (
        "std_msgs/Header header; uint32 height; uint32 width; string distortion_model; "
        "float64[] d; float64[9] k; float64[9] r; float64[12] p; uint32 binning_x; "
        "uint32 binning_y; sensor_msgs/RegionOfInterest roi"
    ),
    "sensor_msgs/Imu": (
        "std_msgs/Header header; geometry_msgs/Quaternion orientation; "
        "float64[9] orientation_covariance; geometry_msgs/Vector3 angular_velocity; "
        "float64[9] angular_velocity_covariance; geometry_msgs/Vector3 linear_acceleration; "
        "float64[9] linear_acceleration_covariance"
    ),
    "sensor_msgs/JointState": (
        "std_msgs/Header header; string[] name; float64[] position; float64[] velocity; "
        "float64[] effort"
    ),
    "nav_msgs/Odometry": (
        "std_msgs/Header header; string child_frame_id; geometry_msgs/PoseWithCovariance pose; "
        "geometry_msgs/TwistWithCovariance twist"
    ),
}
_RULE = "=" * 80


def definition(kind: str) -> str:
    """Give the text of a type and of all that it is made of, as a bag's schema holds it.

    Args:
        kind: Such as ``sensor_msgs/msg/Imu``.
    """
    name = kind.replace("/msg/", "/")
    inside = [part for part in _parts(name) if part != name]
    texts = [_lines(name), *(f"{_RULE}\nMSG: {part}\n{_lines(part)}" for part in inside)]
    return "\n".join(texts)


def _lines(name: str) -> str:
    return "\n".join(_FIELDS[name].split("; "))


def _parts(name: str) -> list[str]:
    """Name a type and all types inside it, each once."""
    found = [name]
    for field in _FIELDS[name].split("; "):
        inner = field.split(" ", 1)[0].removesuffix("[]")
        found += [part for part in (_parts(inner) if inner in _FIELDS else []) if part not in found]
    return list(dict.fromkeys(found))
