"""The picture of a traverse, drawn while it is recorded, in bounded memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording import layout
from lpet_sim.recording.arrays import Ints
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.cloud import LandmarkCloud
from lpet_sim.recording.motions import MovingEntity, Thinner
from lpet_sim.recording.overview import Overview
from lpet_sim.recording.scene import DrawnLink, Mesh
from lpet_sim.recording.sighted import SightedImages
from lpet_sim.recording.streams import SightingStream
from lpet_sim.recording.tracks import colours, images_of
from lpet_sim.recording.truth import BodyTruth, Event, WheelTruth
from lpet_sim.recording.visuals import EVENT_COLOUR, TRUTH_COLOUR, Pen
from lpet_sim.recording.wheel_curves import WheelCurves


class Sketch:
    """Draws the pieces of a traverse as they come, and the whole at the end."""

    def __init__(
        self, pen: Pen, calibration: Calibration, draw_every: int, overview: Overview
    ) -> None:
        """Start where the facts stand.

        Args:
            pen: What draws.
            calibration: What is declared of the sensors.
            draw_every: Of how many images one has its sightings drawn.
            overview: What is known of the traverse already.
        """
        self._pen = pen
        self._stereo = calibration.stereo
        self._wheels = calibration.wheels.names if calibration.wheels is not None else ()
        self._sighted = SightedImages(pen, draw_every)
        self._cloud = LandmarkCloud()
        self._path = Thinner()
        self._curves: WheelCurves | None = None
        self._links = {"": layout.ROVER}
        self._moving: dict[str, MovingEntity] = {}
        self.overview = overview

    def cameras(self) -> None:
        """Draw the declared camera pair."""
        if self._stereo is not None:
            self._pen.cameras(self._stereo)
            aspect = self._stereo.width_px / self._stereo.height_px
            self.overview = replace(self.overview, aspect=aspect)

    def body(self, body: BodyTruth) -> None:
        """Move the rover along a piece of the truth."""
        if len(body):
            self.overview = replace(self.overview, has_truth=True).lasting(body.t_ns)
            self.motion(body.t_ns, {"": body.T_world_body})
            self.poses(body.t_ns, body.T_world_body)

    def poses(self, t_ns: Ints, T_world_body: SE3) -> None:
        """Remember where the rover was."""
        kept = self._path.keep(t_ns)
        self._cloud.add_poses(t_ns[kept], T_world_body[kept])
        self.overview = self.overview.covering(T_world_body.translation)

    def wheels(self, wheels: WheelTruth) -> None:
        """Draw the curves of the wheels."""
        if self._curves is None:
            count = wheels.slip.shape[1]
            names = self._wheels if len(self._wheels) == count else [f"{i}" for i in range(count)]
            self._curves = WheelCurves(self._pen, names)
            self.overview = replace(self.overview, has_wheel_truth=True)
        self._curves.add(wheels)

    def links(self, links: Sequence[DrawnLink]) -> None:
        """Draw the parts of the rover, parents before what hangs on them."""
        for link in links:
            entity = f"{self._links[link.parent]}/{layout.slug(link.name)}"
            self._links[link.name] = entity
            self._pen.pose(entity, link.T_parent_link)
            if link.mesh is not None:
                self._pen.mesh(f"{entity}/mesh", link.mesh)

    def motion(self, t_ns: Ints, motions: Mapping[str, SE3]) -> None:
        """Move parts of the rover in their parents, thinned to `MOTION_PERIOD_NS`."""
        for name, poses in motions.items():
            entity = self._links[name]
            self._moving.setdefault(name, MovingEntity(self._pen, entity)).add(t_ns, poses)
        self.overview = replace(self.overview, has_rover=True)

    def mesh(self, name: str, mesh: Mesh) -> None:
        """Draw a part of the ground."""
        self._pen.mesh(f"{layout.TERRAIN}/{layout.slug(name)}", mesh)

    def image(self, t_ns: Ints) -> None:
        """Count an image pair that is kept, with its time, Shape (1,)."""
        self.overview = replace(self.overview, images=self.overview.images + 1).lasting(t_ns)

    def sightings(self, sightings: SightingStream) -> None:
        """Draw sightings and the tails of their tracks on both images."""
        for t_ns, ids, px in images_of(sightings):
            self._sighted.add(t_ns, ids, px)
            if self._stereo is not None:
                self._cloud.add_sightings(t_ns, ids, px, self._stereo)
        seen = self.overview.sightings + len(sightings.landmark_id)
        self.overview = replace(self.overview, sightings=seen)

    def finish(self, events: Sequence[Event]) -> None:
        """Draw what is known at the end only: whole paths, landmarks, where events happened."""
        for moving in self._moving.values():
            moving.flush()
        if self._curves is not None:
            self._curves.flush()
        path = self._cloud.path()
        if self.overview.has_truth and len(path):
            length = float(np.linalg.norm(np.diff(path, axis=0), axis=-1).sum())
            self.overview = replace(self.overview, distance_m=length)
            self._pen.path(f"{layout.PATHS}/true", path, TRUTH_COLOUR, 3.0)
        self.landmarks()
        if events:
            self._pen.events(events)
            self.overview = replace(self.overview, has_events=True)
            self._mark(events)

    def landmarks(self) -> None:
        """Draw the last sightings, and the landmarks where they could be placed."""
        self._sighted.flush()
        ids, p_world = self._cloud.landmarks()
        if len(ids):
            self._pen.cloud(layout.LANDMARKS, p_world, colours(ids))

    def _mark(self, events: Sequence[Event]) -> None:
        places = self._cloud.places(np.array([event.t_ns for event in events]))
        texts = [event.kind.replace("_", " ") for event in events]
        self._pen.labels(layout.EVENT_PLACES, places, texts, EVENT_COLOUR)
