"""What is seen of a recording in the viewer: meshes, the moving rover, paths, sightings, curves.

All of it is drawn from the exact streams and is never read back; it is in single precision.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray

from lpet_sim.geometry import SE3
from lpet_sim.recording import layout
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.scene import Mesh
from lpet_sim.recording.truth import Event

RGBA = tuple[int, int, int, int]

TIMELINE = "time"
TRUTH_COLOUR: RGBA = (255, 255, 255, 255)
EVENT_COLOUR: RGBA = (255, 160, 40, 255)
ESTIMATE_COLOURS: tuple[RGBA, ...] = (
    (0, 200, 255, 255),
    (255, 60, 200, 255),
    (190, 255, 40, 255),
    (255, 220, 0, 255),
    (150, 120, 255, 255),
    (0, 255, 160, 255),
    (255, 110, 90, 255),
)
_AXIS_COLOURS: tuple[RGBA, ...] = ((255, 90, 90, 255), (100, 230, 100, 255), (110, 160, 255, 255))
_WHEEL_COLOURS: tuple[RGBA, ...] = (
    (255, 99, 99, 255),
    (255, 176, 77, 255),
    (240, 230, 90, 255),
    (110, 220, 120, 255),
    (90, 190, 255, 255),
    (200, 140, 255, 255),
)
# Pixel (0, 0) is the centre of the first one here and its corner in the viewer.
_HALF_PIXEL = 0.5
_FRUSTUM_M = 1.0


class Pen:
    """Draws into a recording stream."""

    def __init__(self, stream: rr.RecordingStream) -> None:
        """Set the world up: z is up, and the camera pair stands on the rover."""
        self._stream = stream
        self._styled: set[str] = set()
        self._static(layout.WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)

    def mesh(self, entity: str, mesh: Mesh) -> None:
        """Draw a mesh that does not change."""
        mesh = mesh.faceted() if mesh.flat else mesh
        rgba = np.broadcast_to(mesh.rgba, (len(mesh.vertices_m), 4))
        shape = rr.Mesh3D(
            vertex_positions=mesh.vertices_m.astype(np.float32),
            triangle_indices=mesh.faces.astype(np.uint32),
            vertex_normals=_normals(mesh),
            vertex_colors=np.ascontiguousarray(rgba),
        )
        self._static(entity, shape)

    def pose(self, entity: str, pose: SE3) -> None:
        """Place an entity for good in its parent."""
        self._static(entity, rr.Transform3D(translation=pose.translation, mat3x3=pose.rotation))

    def poses(self, entity: str, t_ns: Ints, poses: SE3) -> None:
        """Move an entity in its parent."""
        matrices = poses.rotation.reshape(-1, 9).astype(np.float32)
        columns = rr.Transform3D.columns(
            translation=poses.translation.astype(np.float32), mat3x3=matrices
        )
        self._send(entity, t_ns, columns)

    def cameras(self, stereo: StereoCalibration) -> None:
        """Draw the declared camera pair on the rover."""
        T_body_camera = stereo.T_body_camera.se3()
        T_camera_right = SE3(np.eye(3), np.array([stereo.baseline_m, 0.0, 0.0]))
        eyes = {"left": T_body_camera, "right": T_body_camera @ T_camera_right}
        centre = [stereo.cx_px + _HALF_PIXEL, stereo.cy_px + _HALF_PIXEL]
        for eye, pose in eyes.items():
            self.pose(layout.CAMERAS[eye], pose)
            pinhole = rr.Pinhole(
                focal_length=stereo.focal_px,
                principal_point=centre,
                resolution=[stereo.width_px, stereo.height_px],
                image_plane_distance=_FRUSTUM_M,
                color=(255, 200, 90, 255),
            )
            self._static(layout.CAMERAS[eye], pinhole)

    def points_2d(
        self, entity: str, t_ns: Ints, px: Array, counts: Ints, rgba: NDArray[np.uint32]
    ) -> None:
        """Draw points on an image, those of time i being the next ``counts[i]`` rows."""
        columns = rr.Points2D.columns(positions=(px + _HALF_PIXEL).astype(np.float32), colors=rgba)
        self._style(entity, rr.Points2D.from_fields(radii=rr.Radius.ui_points(2.5)))
        self._send(entity, t_ns, columns.partition(counts))

    def strips_2d(
        self,
        entity: str,
        t_ns: Ints,
        px: Array,
        lengths: Ints,
        counts: Ints,
        rgba: NDArray[np.uint32],
    ) -> None:
        """Draw polylines on an image, those of time i being the next ``counts[i]`` of them."""
        flat = pa.array((px + _HALF_PIXEL).astype(np.float32).reshape(-1))
        points = pa.FixedSizeListArray.from_arrays(flat, type=_STRIP.value_type)
        offsets = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int32)
        strips = pa.ListArray.from_arrays(pa.array(offsets), points, type=_STRIP)
        columns = rr.LineStrips2D.columns(strips=strips, colors=rgba)
        self._style(entity, rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(1.0)))
        self._send(entity, t_ns, columns.partition(counts))

    def path(self, entity: str, points_m: Array, rgba: RGBA, width: float) -> None:
        """Draw a whole path, so that it is seen at any time."""
        strip = rr.LineStrips3D(
            [points_m.astype(np.float32)], colors=[rgba], radii=rr.Radius.ui_points(width)
        )
        self._static(entity, strip)

    def marker(self, entity: str, t_ns: Ints, points_m: Array, rgba: RGBA) -> None:
        """Draw a point that moves along a path."""
        style = rr.Points3D.from_fields(radii=rr.Radius.ui_points(6.0), colors=[rgba])
        self._style(entity, style)
        self._send(entity, t_ns, rr.Points3D.columns(positions=points_m.astype(np.float32)))

    def labels(self, entity: str, points_m: Array, texts: Sequence[str], rgba: RGBA) -> None:
        """Draw labelled points that stay."""
        cloud = rr.Points3D(
            points_m,
            labels=list(texts),
            colors=[rgba],
            radii=rr.Radius.ui_points(5.0),
            show_labels=True,
        )
        self._static(entity, cloud)

    def cloud(self, entity: str, points_m: Array, rgba: NDArray[np.uint32]) -> None:
        """Draw points that stay."""
        radii = rr.Radius.ui_points(1.2)
        self._static(entity, rr.Points3D(points_m.astype(np.float32), colors=rgba, radii=radii))

    def curve(self, entity: str, t_ns: Ints, values: Array) -> None:
        """Draw a curve over time."""
        self._send(entity, t_ns, rr.Scalars.columns(scalars=values))

    def curve_style(
        self, entity: str, names: Sequence[str], rgba: Sequence[RGBA], width: float = 1.5
    ) -> None:
        """Set names and colours of the curves of an entity."""
        style = rr.SeriesLines(names=list(names), colors=list(rgba), widths=[width] * len(names))
        self._static(entity, style)

    def wheel_curve_style(self, entity: str, names: Sequence[str]) -> None:
        """Set names and colours of curves that belong to the wheels."""
        colours = [_WHEEL_COLOURS[i % len(_WHEEL_COLOURS)] for i in range(len(names))]
        self.curve_style(entity, names, colours)

    def axis_curve_style(self, entity: str, names: Sequence[str]) -> None:
        """Set names and colours of curves of roll, pitch and yaw."""
        self.curve_style(entity, names, _AXIS_COLOURS)

    def events(self, events: Sequence[Event]) -> None:
        """Write the events into the text log."""
        t_ns = np.array([event.t_ns for event in events], dtype=np.int64)
        texts = [_event_text(event) for event in events]
        self._send(layout.EVENT_LOG, t_ns, rr.TextLog.columns(text=texts))

    def document(self, entity: str, markdown: str) -> None:
        """Set a text."""
        self._static(entity, rr.TextDocument(markdown, media_type=rr.MediaType.MARKDOWN))

    def _style(self, entity: str, style: rr.AsComponents) -> None:
        """Set the look of an entity, once."""
        if entity not in self._styled:
            self._styled.add(entity)
            self._static(entity, style)

    def _static(self, entity: str, value: rr.AsComponents) -> None:
        self._stream.log(entity, value, static=True, strict=True)

    def _send(self, entity: str, t_ns: Ints, columns: rr.ComponentColumnList) -> None:
        index = rr.TimeColumn(TIMELINE, duration=t_ns.astype("timedelta64[ns]"))
        self._stream.send_columns(entity, [index], columns, strict=True)


_STRIP = rr.components.LineStrip2DBatch._ARROW_DATATYPE


def _event_text(event: Event) -> str:
    lasted = f" for {event.duration_s:g} s" if event.duration_s else ""
    return f"{event.kind.replace('_', ' ')}{lasted}: {event.text}"


def _normals(mesh: Mesh) -> NDArray[np.float32]:
    """Average the normals of the faces around each corner, weighted by area."""
    v, f = mesh.vertices_m, mesh.faces
    face_normals = np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]])
    sums = np.stack(
        [np.bincount(f.reshape(-1), np.repeat(face_normals[:, k], 3), len(v)) for k in range(3)], -1
    )
    length = np.linalg.norm(sums, axis=-1, keepdims=True)
    return (sums / np.where(length > 0, length, 1.0)).astype(np.float32)
