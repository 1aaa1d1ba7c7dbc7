"""What is drawn beside the exact streams: views, rover, sightings with tails, landmarks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lpet_sim.geometry import SE3
from lpet_sim.recording import layout
from lpet_sim.recording.cloud import LandmarkCloud, Reservoir
from lpet_sim.recording.motions import Thinner
from lpet_sim.recording.overlay import add_estimate
from lpet_sim.recording.reader import open_store
from lpet_sim.recording.scene import DrawnLink, Mesh, join_meshes
from lpet_sim.recording.store import StoreReader
from lpet_sim.recording.tracks import TrackTails, colours
from lpet_sim.recording.writer import RecordingWriter
from tests.recording import synthetic

TRIANGLE = Mesh(
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]),
    np.array([[0, 1, 2]]),
    np.array([90, 60, 40, 255], np.uint8),
)


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> StoreReader:
    """Write a recording with everything that can be drawn."""
    path: Path = tmp_path_factory.mktemp("drawn") / "run.rrd"
    whole = synthetic.recording(8.0)
    m = whole.measurements
    with RecordingWriter(path, whole.manifest, m.calibration) as out:
        out.draw_mesh("ground", TRIANGLE)
        out.draw_rover([DrawnLink("body", TRIANGLE), DrawnLink("wheel", TRIANGLE, "body")])
        out.log_truth(whole.truth)
        poses = SE3.identity(len(whole.truth.wheels))
        out.draw_motion(whole.truth.wheels.t_ns, {"wheel": poses})
        for i, t_ns in enumerate(m.images.t_ns):
            out.log_images(int(t_ns), *m.images.pair(i))
        out.log_sightings(m.sightings)
    add_estimate(path, synthetic.estimate("vme", 8.0))
    return open_store(path)


def rows_of(store: StoreReader, entity: str, component: str) -> list[list[object]]:
    """Read one component of an entity, a list for each time."""
    batches = [chunk.to_record_batch() for chunk in store.chunks(entity)]
    return [
        row
        for b in batches
        if component in b.schema.names
        for row in b.column(component).to_pylist()
    ]


def test_the_arrangement_of_views_is_in_the_file(drawn: StoreReader) -> None:
    """Opening the file needs nothing else."""
    assert drawn.has_blueprint


def test_all_that_is_to_be_seen_is_drawn(drawn: StoreReader) -> None:
    """Ground, rover, both images with sightings and tails, paths, events, summary."""
    cameras = list(layout.CAMERAS.values())
    wanted = {f"{layout.TERRAIN}/ground", f"{layout.ROVER}/body/wheel/mesh", layout.LANDMARKS}
    wanted |= {f"{c}/{what}" for c in cameras for what in ("image", "sightings", "tracks")}
    wanted |= {f"{layout.PATHS}/true", f"{layout.PATHS}/vme/line", layout.EVENT_LOG, layout.SUMMARY}
    assert wanted <= drawn.entities()


def test_the_points_on_the_images_are_the_sightings(drawn: StoreReader) -> None:
    """Each image has its points, half a pixel on: the viewer counts from the corner."""
    sightings = synthetic.sightings(8.0)
    for eye, column in layout.EYE_COLUMNS.items():
        rows = rows_of(drawn, f"{layout.CAMERAS[eye]}/sightings", "Points2D:positions")
        assert [len(r) for r in rows] == list(np.diff(sightings.offsets))
        flat = np.array([point for row in rows for point in row])
        assert np.allclose(flat - 0.5, sightings.stereo_px[:, [column, 2]], atol=1e-4)


def test_the_rover_moves_with_the_truth(drawn: StoreReader) -> None:
    """Its poses are the true ones, five a second."""
    rows = rows_of(drawn, layout.ROVER, "Transform3D:translation")
    places = np.array([row[0] for row in rows])
    body = synthetic.truth(8.0).body
    assert np.allclose(places, body.T_world_body.translation[::20], atol=1e-5)


def test_the_true_path_is_drawn_whole_at_any_time(drawn: StoreReader) -> None:
    """The line is static and runs from the start to the end."""
    (row,) = rows_of(drawn, f"{layout.PATHS}/true", "LineStrips3D:strips")
    line = np.array(row[0])
    p = synthetic.truth(8.0).body.T_world_body.translation
    assert np.allclose(line[0], p[0], atol=1e-4) and np.allclose(line[-1], p[-1], atol=0.03)


def _at(u_px: float) -> np.ndarray:
    return np.array([[u_px, u_px - 1.0, 5.0]])


def test_tails_follow_a_landmark_through_a_gap() -> None:
    """A tail holds the places of its landmark in the last images, newest first."""
    tails = TrackTails(images=3)
    assert len(tails.add(np.array([7]), _at(1.0)).lengths) == 0
    assert len(tails.add(np.array([8]), _at(9.0)).lengths) == 0
    found = tails.add(np.array([7]), _at(2.0))
    assert list(found.points_px[:, 0]) == [2.0, 1.0] and list(found.landmark_id) == [7]
    tails.add(np.zeros(0, np.int64), np.zeros((0, 3)))
    assert list(tails.add(np.array([7]), _at(3.0)).points_px[:, 0]) == [3.0, 2.0]
    tails.add(np.array([1]), _at(0.0))
    tails.add(np.array([1]), _at(0.0))
    tails.add(np.array([1]), _at(0.0))
    assert len(tails.add(np.array([7]), _at(4.0)).lengths) == 0


def test_landmarks_have_colours_of_their_own() -> None:
    """Neighbouring ids differ; the same id is always the same; all are opaque."""
    first, second = colours(np.arange(50)), colours(np.arange(50))
    assert np.array_equal(first, second) and len(set(first.tolist())) == 50
    assert np.all(first & 255 == 255)


def test_landmarks_are_placed_where_they_stand() -> None:
    """Sightings made by projection come back to the points that were projected."""
    stereo = synthetic.calibration().stereo
    truth = synthetic.truth(8.0)
    t_ns = synthetic.image_times(8.0)
    T_world_camera = truth.trajectory.at(t_ns) @ stereo.T_body_camera.se3()
    p_camera = np.array([[0.3, 0.2, 4.0], [-0.5, 0.1, 6.0], [0.0, 0.0, 500.0]])
    cloud = LandmarkCloud()
    for t in t_ns:
        cloud.add_sightings(int(t), np.array([3, 4, 5]), stereo.project(p_camera), stereo)
    cloud.add_poses(truth.body.t_ns, truth.body.T_world_body)
    ids, p_world = cloud.landmarks()
    assert set(ids) == {3, 4}
    expected = np.concatenate([T_world_camera[i] @ p_camera[:2] for i in range(len(t_ns))])
    assert np.allclose(p_world, expected, atol=1e-9)


@pytest.mark.parametrize("pieces", [1, 7, 1000])
def test_a_reservoir_is_an_even_sample_however_it_is_filled(pieces: int) -> None:
    """It never exceeds its size, and keeps every k-th row for one k."""
    rows = np.arange(1000.0)[:, None]
    reservoir = Reservoir(1, max_rows=64)
    for piece in np.array_split(rows, pieces):
        reservoir.add(piece)
        assert len(reservoir.rows()) <= 64
    assert np.array_equal(reservoir.rows(), rows[::16])


def test_a_thinner_does_not_see_the_cuts() -> None:
    """Cutting a stream does not change which rows are kept."""
    t_ns = np.arange(0, 10**10, 7 * 10**6)
    whole = t_ns[Thinner().keep(t_ns)]
    thinner = Thinner()
    pieces = [piece[thinner.keep(piece)] for piece in np.array_split(t_ns, 13)]
    assert np.array_equal(np.concatenate(pieces), whole) and len(whole) == 50


def test_meshes_are_joined_with_their_corners() -> None:
    """Faces point at the corners of their own mesh."""
    both = join_meshes([TRIANGLE, Mesh(TRIANGLE.vertices_m + 5.0, TRIANGLE.faces, TRIANGLE.rgba)])
    assert both.faces.tolist() == [[0, 1, 2], [3, 4, 5]] and both.rgba.shape == (6, 4)
    assert both.vertices_m[both.faces[1]].min() == 5.0
