"""Which landmarks an image shows: field of view, range, incidence, and what stands between."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial import Delaunay

from lpet_sim.geometry import SE3
from lpet_sim.sensors.landmark_field import FAR, GROUND, ROCK
from lpet_sim.sensors.landmark_sensor import ShownLandmarks, sense_landmarks, show_landmarks
from lpet_sim.sensors.landmark_spec import LandmarkFieldSpec, LandmarkSensorSpec, VisibilitySpec
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.load import load_terrain_spec
from lpet_sim.terrain.terrain import Terrain, build_terrain
from tests.sensors.landmark_worlds import (
    ALL_IN_RANGE,
    CAMERA,
    GROUND_ONLY,
    MadeUpTerrain,
    camera_poses,
    sensor,
    straight_drive,
)

SEED = 5


@pytest.fixture(scope="module")
def exomars() -> Terrain:
    """Build the terrain of the paper's experiment."""
    return build_terrain(load_terrain_spec("exomars"), SEED)


def look(terrain: Any, spec: LandmarkSensorSpec, length_m: float = 0.0) -> ShownLandmarks:
    """Look along a straight drive."""
    return show_landmarks(straight_drive(length_m, terrain), terrain, CAMERA, spec, SEED)


def in_camera(shown: ShownLandmarks, length_m: float, terrain: Any) -> np.ndarray:
    """Give the landmarks in the left eye [m], Shape (m, 3)."""
    poses = camera_poses(straight_drive(length_m, terrain), shown.t_ns)
    p = shown.p_world - poses.translation[shown.image]
    return np.asarray(np.einsum("nij,ni->nj", poses.rotation[shown.image], p))


def test_without_noise_sightings_are_projections_of_fixed_points(exomars: Terrain) -> None:
    """Triangulated from the true poses, a name is one point of the world in all images."""
    drive = straight_drive(2.0, exomars)
    seen = sense_landmarks(drive, exomars, CAMERA, sensor(), SEED)
    image = np.repeat(np.arange(len(seen)), np.diff(seen.offsets))
    poses = camera_poses(drive, seen.t_ns)
    p_camera = CAMERA.triangulate(seen.stereo_px)
    p_world = np.einsum("nij,nj->ni", poses.rotation[image], p_camera) + poses.translation[image]
    _, first, inverse = np.unique(seen.landmark_id, return_index=True, return_inverse=True)
    off = np.linalg.norm(p_world - p_world[first][inverse], axis=1)
    depth = p_camera[:, 2]
    assert len(first) > 50
    assert np.diff(seen.offsets).min() >= 20
    assert np.all(off < 1e-11 * depth**2 + 1e-9)
    assert depth.min() < 3.0 < 500.0 < depth.max()


def test_both_eyes_hold_what_is_shown_and_nothing_in_view_is_left_out() -> None:
    """On bare level ground it is the landmarks whose projections lie inside, and those alone."""
    visibility = ALL_IN_RANGE.model_copy(update={"border_px": 30.0})
    spec = sensor(field=GROUND_ONLY, visibility=visibility)
    wide = visibility.model_copy(update={"border_px": 0.0})
    inside, all_of_it = (
        look(MadeUpTerrain(), spec.model_copy(update={"visibility": v})) for v in (visibility, wide)
    )
    px = all_of_it.stereo_px
    kept = (px[:, 1] >= 30) & (px[:, 0] <= 1023 - 30) & (px[:, 2] >= 30) & (px[:, 2] <= 1023 - 30)
    assert 0 < kept.sum() < len(kept)
    assert set(inside.landmark_id) == set(all_of_it.landmark_id[kept])


def test_range_and_incidence_end_where_they_should() -> None:
    """On level ground the angle to the normal follows from the eye's height."""
    visibility = ALL_IN_RANGE.model_copy(
        update={"range_min_m": 2.5, "range_max_m": 9.0, "incidence_max_rad": math.radians(78.0)}
    )
    spec = sensor(field=GROUND_ONLY, visibility=visibility)
    terrain = MadeUpTerrain()
    eye_m = float(camera_poses(straight_drive(0.0), np.array([0])).translation[0, 2])
    distance = np.linalg.norm(in_camera(look(terrain, spec), 0.0, terrain), axis=1)
    steepest_m = eye_m / math.cos(math.radians(78.0))
    assert 2.5 <= distance.min() < 2.8
    assert steepest_m - 0.4 < distance.max() <= steepest_m < 9.0
    flat = spec.model_copy(
        update={"visibility": visibility.model_copy(update={"incidence_max_rad": math.pi / 2})}
    )
    distance = np.linalg.norm(in_camera(look(terrain, flat), 0.0, terrain), axis=1)
    assert 8.7 < distance.max() <= 9.0


def test_fewer_landmarks_are_seen_from_further_away() -> None:
    """The share seen at range r is (range_full / r)^2, so it is a quarter at twice the range."""
    terrain = MadeUpTerrain()
    field = GROUND_ONLY.model_copy(update={"ground_per_m2": 10.0})
    full = sensor(field=field, visibility=ALL_IN_RANGE)
    fading = ALL_IN_RANGE.model_copy(update={"range_exponent": 2.0, "range_full_m": 3.0})
    some = full.model_copy(update={"visibility": fading})
    every, seen = look(terrain, full), look(terrain, some)
    assert set(seen.landmark_id) < set(every.landmark_id)
    distance = np.linalg.norm(in_camera(every, 0.0, terrain), axis=1)
    kept = np.isin(every.landmark_id, seen.landmark_id)
    assert kept[distance < 3.0].all()
    for low, high in ((3.0, 6.0), (6.0, 12.0)):
        ring = (distance >= low) & (distance < high)
        expected = np.mean((3.0 / distance[ring]) ** 2)
        spread = math.sqrt(expected * (1 - expected) / ring.sum())
        assert kept[ring].mean() == pytest.approx(expected, abs=4 * spread)


def test_a_wall_hides_what_lies_behind_it() -> None:
    """Nothing of the ground behind a wall higher than the eye is shown, all before it is."""

    def wall(xy: np.ndarray) -> np.ndarray:
        return np.asarray(np.where((xy[:, 0] > 6.0) & (xy[:, 0] < 6.5), 3.0, 0.0))

    terrain = MadeUpTerrain(wall)
    open_view = sensor(field=GROUND_ONLY, visibility=ALL_IN_RANGE)
    closed = open_view.model_copy(
        update={"visibility": ALL_IN_RANGE.model_copy(update={"occlusion": True})}
    )
    every, seen = look(terrain, open_view), look(terrain, closed)
    behind = every.p_world[:, 0] > 6.5
    before = every.p_world[:, 0] < 5.9
    assert behind.sum() > 20
    assert seen.p_world[:, 0].max() < 6.5
    assert np.isin(every.landmark_id[before], seen.landmark_id).all()


def test_a_rock_hides_what_lies_behind_it_and_its_own_far_side() -> None:
    """Landmarks on the rock face the eye; the ground in its shadow is not shown."""
    terrain = MadeUpTerrain(stones=((5.0, 0.0, 1.6),))
    field = LandmarkFieldSpec(ground_per_m2=10.0, per_rock=10.0, far_per_rad=0.0)
    flat = {"incidence_max_rad": math.pi / 2}
    visibility = ALL_IN_RANGE.model_copy(update=flat | {"occlusion": True})
    seen = look(terrain, sensor(field=field, visibility=visibility))
    every = look(terrain, sensor(field=field, visibility=ALL_IN_RANGE.model_copy(update=flat)))
    eye = camera_poses(straight_drive(0.0), np.array([0])).translation[0]
    solids = _solids(terrain, eye)
    in_shadow = np.array([_blocked(solids, eye, p) for p in every.p_world])
    assert 10 < in_shadow.sum() < 0.5 * len(in_shadow)
    assert not np.isin(every.landmark_id[in_shadow], seen.landmark_id).any()
    on_rock = seen.kind == ROCK
    assert on_rock.any()
    assert np.all(seen.p_world[on_rock, 0] < 5.8)
    ground = every.kind == GROUND
    lost = ground & ~in_shadow & ~np.isin(every.landmark_id, seen.landmark_id)
    assert lost.sum() < 0.1 * in_shadow.sum()  # hidden from the right eye alone


Solid = tuple[np.ndarray, float, Delaunay]


def _solids(terrain: Any, eye: np.ndarray) -> list[Solid]:
    """Give place, reach and a triangulation of every rock within 14 m of an eye."""
    rocks = terrain.rocks(Box.around(float(eye[0]), float(eye[1]), 14.0), 0.1)
    return [
        (
            rocks.p_world_rock[k, :2],
            float(rocks.reach_m[k]),
            Delaunay(0.999 * rocks.mesh(k)[0] + rocks.p_world_rock[k]),
        )
        for k in range(len(rocks))
    ]


def _blocked(solids: list[Solid], eye: np.ndarray, p: np.ndarray) -> bool:
    """Tell by dense samples whether a line, all but its last centimetre, passes inside a rock."""
    length = float(np.linalg.norm(p - eye))
    line = eye + np.arange(0.0, length - 0.01, 0.005)[:, None] / length * (p - eye)
    flat = p[:2] - eye[:2]
    for place, reach_m, solid in solids:
        along = np.clip((place - eye[:2]) @ flat / max(flat @ flat, 1e-12), 0.0, 1.0)
        if np.linalg.norm(place - eye[:2] - along * flat) > reach_m:
            continue
        close = line[np.linalg.norm(line[:, :2] - place, axis=1) < reach_m]
        if len(close) and np.any(solid.find_simplex(close) >= 0):
            return True
    return False


def _clearance(terrain: Terrain, eye: np.ndarray, p: np.ndarray) -> float:
    """Give how far the ground stays below a line, all but its last 5 cm [m]."""
    reach = float(np.linalg.norm((p - eye)[:2]))
    t = np.arange(0.0, reach - 0.05, 0.02) / reach
    line = eye + t[:, None] * (p - eye)
    return float(np.min(line[:, 2] - terrain.height(line[:, :2])))


def test_occlusion_agrees_with_dense_samples_of_the_terrain_itself(exomars: Terrain) -> None:
    """Ground at any resolution and rocks by another method: they differ on grazing lines only."""
    changes = {"range_max_m": 13.0, "incidence_max_rad": math.pi / 2}
    field = LandmarkFieldSpec(ground_per_m2=3.0, per_rock=1.5, far_per_rad=0.0)
    every, seen = (
        look(
            exomars,
            sensor(
                field=field,
                visibility=ALL_IN_RANGE.model_copy(update=changes | {"occlusion": occlusion}),
            ),
        )
        for occlusion in (False, True)
    )
    pose = camera_poses(straight_drive(0.0, exomars), np.array([0]))
    eyes = [pose.translation[0], pose.translation[0] + CAMERA.baseline_m * pose.rotation[0][:, 0]]
    solids = _solids(exomars, eyes[0])
    shown = np.isin(every.landmark_id, seen.landmark_id)
    clear = np.array([min(_clearance(exomars, eye, p) for eye in eyes) for p in every.p_world])
    behind = np.array([any(_blocked(solids, eye, p) for eye in eyes) for p in every.p_world])
    hidden, free = behind | (clear < -0.02), ~behind & (clear > 0.0)
    assert min(hidden.sum(), free.sum()) > 30
    assert not shown[hidden].any()
    assert shown[free].mean() > 0.98


def test_the_cap_keeps_the_strongest_of_those_shown(exomars: Terrain) -> None:
    """The same landmarks come first, however many are taken."""
    all_of_them = VisibilitySpec(sightings_max=None)
    few = VisibilitySpec(sightings_max=10)
    every, capped = (look(exomars, sensor(visibility=v), 0.5) for v in (all_of_them, few))
    for image in range(len(every.t_ns)):
        names = every.landmark_id[every.offsets[image] : every.offsets[image + 1]]
        kept = capped.landmark_id[capped.offsets[image] : capped.offsets[image + 1]]
        assert len(names) > 10
        assert np.array_equal(kept, names[:10])


def test_far_landmarks_lie_on_the_relief_and_stay_in_view_for_30_m(exomars: Terrain) -> None:
    """Their disparity is below two pixels, and half of the first image's are in the last one."""
    spec = sensor(period_s=30.0, visibility=VisibilitySpec(sightings_max=None))
    seen = look(exomars, spec, 30.0)
    far = seen.kind == FAR
    names = [set(seen.landmark_id[far & (seen.image == image)]) for image in range(len(seen.t_ns))]
    assert min(map(len, names)) >= 5
    assert len(names[0] & names[-1]) >= 0.5 * len(names[0])
    assert (seen.stereo_px[far, 0] - seen.stereo_px[far, 1]).max() < 2.05
    assert np.linalg.norm(in_camera(seen, 30.0, exomars)[far], axis=1).min() >= 60.0
    assert seen.p_world[far, 2] == pytest.approx(exomars.height(seen.p_world[far, :2]))


def test_far_landmarks_stand_at_the_skyline(exomars: Terrain) -> None:
    """Nothing behind or before one stands a pixel higher on its bearing, for most of them."""
    seen = look(exomars, sensor(visibility=VisibilitySpec(sightings_max=None)))
    far = seen.p_world[seen.kind == FAR]
    eye = camera_poses(straight_drive(0.0, exomars), np.array([0])).translation[0]
    distance = np.geomspace(60.0, 8000.0, 4000)
    below = []
    for p in far:
        towards = (p - eye)[:2] / np.linalg.norm((p - eye)[:2])
        z = exomars.height(eye[:2] + distance[:, None] * towards)
        own = (p[2] - eye[2]) / np.linalg.norm((p - eye)[:2])
        below.append(np.max((z - eye[2]) / distance) - own)
    assert np.median(below) < 1.0 / CAMERA.focal_px


def test_landmarks_belong_to_their_places_and_not_to_the_path(exomars: Terrain) -> None:
    """Two drives that cross see the same names at the same points."""
    spec = sensor(visibility=VisibilitySpec(sightings_max=None))
    one = look(exomars, spec, 2.0)
    drive = straight_drive(2.0, exomars, (0.5, -1.0), heading=0.4)
    other = show_landmarks(drive, exomars, CAMERA, spec, SEED)
    places = dict(zip(one.landmark_id, one.p_world, strict=True))
    both = [k for k, name in enumerate(other.landmark_id) if name in places]
    assert len({other.landmark_id[k] for k in both}) > 20
    for k in both:
        assert np.array_equal(other.p_world[k], places[other.landmark_id[k]])


def test_the_same_seed_gives_the_same_bits_and_another_other_landmarks(exomars: Terrain) -> None:
    """Twice the same call, on terrain that was asked before and on new one."""
    drive, spec = straight_drive(0.5, exomars), LandmarkSensorSpec()
    first = sense_landmarks(drive, exomars, CAMERA, spec, SEED)
    fresh = build_terrain(load_terrain_spec("exomars"), SEED)
    assert first.equals(sense_landmarks(drive, fresh, CAMERA, spec, SEED))
    other = sense_landmarks(drive, exomars, CAMERA, spec, SEED + 1)
    assert not set(first.landmark_id) & set(other.landmark_id)


def test_defaults_show_about_forty_sightings_an_image_on_the_paper_s_terrain(
    exomars: Terrain,
) -> None:
    """A traverse of 6 m; a quarter of them is far, and most are nearer than 10 m."""
    spec = LandmarkSensorSpec(period_s=2.0)
    drive = straight_drive(6.0, exomars)
    seen = sense_landmarks(drive, exomars, CAMERA, spec, SEED)
    assert 33 <= np.diff(seen.offsets).mean() <= 47
    assert seen.t_ns[0] == drive.t_ns[0]
    assert np.all(np.diff(seen.t_ns) == 2_000_000_000)


def test_looking_at_the_sky_shows_nothing() -> None:
    """An image without landmarks is an image with no rows."""
    up = SE3.from_rpy([0.0, -1.4, 0.0], [0.0, 0.0, 0.4])
    drive = straight_drive(0.2)
    turned = type(drive)(
        drive.t_ns.copy(),
        SE3(np.tile(up.rotation, (len(drive), 1, 1)), drive.T_world_body.translation.copy()),
        drive.v_world_body_mps.copy(),
        drive.omega_body_radps.copy(),
    )
    seen = sense_landmarks(turned, MadeUpTerrain(), CAMERA, sensor(), SEED)  # type: ignore[arg-type]
    assert len(seen) == 3
    assert len(seen.landmark_id) == 0
