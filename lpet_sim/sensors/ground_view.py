"""The ground and rocks around an eye, brought up to date as it moves, and drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.sensors import clipmap
from lpet_sim.sensors.camera_spec import GroundDetailSpec
from lpet_sim.sensors.clipmap import TILES, Level
from lpet_sim.sensors.ground_texture import GroundTexture, pyramid
from lpet_sim.sensors.render_layout import Eye, MeshLayout
from lpet_sim.sensors.render_scene import RenderScene
from lpet_sim.sensors.rock_look import ATLAS, GROUPS, RockLook, RockMesh, pack, split_groups
from lpet_sim.sensors.sky import HORIZON_RADIANCE
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.terrain import Terrain

HAZE_M = 25_000.0
"""Distance at which dust hides all; the scale of visibility at an optical depth near 0.5
[recalled]."""

_ROCK_LEVELS = 4
_ROCK_MIN_TEXELS = 12.0
_BLOCKS = TILES * TILES
_VIEW_MARGIN_PX = 24.0
_LOD_BIAS = 0.5


@dataclass
class _Window:
    """What a level shows now: its first tile, its node heights, and the tile in each slot."""

    first: tuple[int, int]
    z: Array
    baked: dict[tuple[int, int], tuple[int, int]] = field(default_factory=dict)


class GroundView:
    """Levels of ground and groups of rocks in a render scene."""

    def __init__(self, terrain: Terrain, spec: GroundDetailSpec, eyes: Sequence[Eye]) -> None:
        self._terrain, self._spec, self._eyes = terrain, spec, list(eyes)
        self._levels = clipmap.make_levels(spec)
        self._texture = GroundTexture(terrain)
        self._rocks = RockLook(terrain, self._texture.key)
        self._windows: list[_Window | None] = [None] * len(self._levels)
        self._rock_faces = spec.rock_faces // GROUPS
        self._scene = RenderScene(
            self._eyes,
            self._layouts(),
            [*(TILES * level.texels for level in self._levels), ATLAS],
            spec.supersampling,
            (HORIZON_RADIANCE, HAZE_M),
        )
        for index, level in enumerate(self._levels):
            self._scene.sharpen(index, int(np.log2(level.texels)), _LOD_BIAS)
        count = len(self._levels) * _BLOCKS + GROUPS
        self._low, self._high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        self._origins = np.zeros((count, 3))

    def _layouts(self) -> list[MeshLayout]:
        ground = [
            MeshLayout((level.cells + 1) ** 2, clipmap.block_faces(level.cells), index)
            for index, level in enumerate(self._levels)
            for _ in range(_BLOCKS)
        ]
        single = np.arange(3 * self._rock_faces).reshape(-1, 3)
        rocks = MeshLayout(3 * self._rock_faces, single, len(self._levels))
        return ground + [rocks] * GROUPS

    def draw(self, eye: int, T_world_camera: SE3) -> NDArray[np.uint16]:
        """Draw what an eye sees, as `RenderScene.draw` gives it."""
        shown, T_draw_camera = self._prepare(eye, T_world_camera)
        return self._scene.draw(eye, T_draw_camera, shown)

    def draw_depth(self, eye: int, T_world_camera: SE3) -> Array:
        """Draw the inverse depth, as `RenderScene.draw_depth` gives it."""
        shown, T_draw_camera = self._prepare(eye, T_world_camera)
        return self._scene.draw_depth(eye, T_draw_camera, shown)

    def close(self) -> None:
        """Free the scene's context."""
        self._scene.close()

    def _prepare(self, eye: int, T_world_camera: SE3) -> tuple[NDArray[np.bool_], SE3]:
        """Bring all that is in view up to date, in a frame near the camera.

        The renderer computes in single precision: kilometres from the origin that would be worth
        a tenth of a pixel.
        """
        if eye == 0:
            self._move_windows(T_world_camera)
        origin = np.floor(T_world_camera.translation)
        shown = self._in_view(eye, T_world_camera)
        self._bake(shown)
        for index in np.flatnonzero(shown):
            self._scene.place_mesh(int(index), self._origins[index] - origin)
        return shown, SE3(T_world_camera.rotation, T_world_camera.translation - origin)

    def _move_windows(self, T_world_camera: SE3) -> None:
        """Move the windows that are off their best place, and make what changes with them."""
        ahead = T_world_camera.rotation[:2, 2]
        ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9) * self._spec.ahead_m
        centre = T_world_camera.translation[:2] + ahead
        moved = []
        for index, level in enumerate(self._levels):
            window = self._windows[index]
            first = clipmap.place_window(level, centre, window.first if window else None)
            if window is None or first != window.first:
                z = clipmap.window_heights(self._terrain, level, first)
                baked = window.baked if window else {}
                self._windows[index] = _Window(first, z, baked)
                moved.append(index)
        for index in sorted({k for m in moved for k in (m, m + 1) if k < len(self._levels)}):
            self._remesh(index)
        if any(index < _ROCK_LEVELS for index in moved):
            self._gather_rocks()

    def _window(self, index: int) -> _Window:
        window = self._windows[index]
        if window is None:
            raise RuntimeError("the windows are placed before they are drawn")
        return window

    def _active(self, index: int) -> Box:
        return clipmap.active_box(self._levels[index], self._window(index).first)

    def _remesh(self, index: int) -> None:
        """Upload the blocks of a level whose window, or whose hole, has moved."""
        level, window = self._levels[index], self._window(index)
        inside, hole = self._active(index), self._active(index - 1) if index else None
        for block in range(_BLOCKS):
            column, row = block % TILES, block // TILES
            tile = (window.first[0] + column, window.first[1] + row)
            kept = clipmap.kept_cells(level, tile, inside, hole)
            mesh = index * _BLOCKS + block
            if not kept.any():
                self._low[mesh], self._high[mesh] = np.inf, -np.inf
                continue
            corners = clipmap.block_vertices(level, window.z, (column, row))
            places = clipmap.block_texcoords(level.cells, (tile[0] % TILES, tile[1] % TILES))
            self._scene.upload_mesh(mesh, corners, places, np.repeat(kept, 2))
            self._origins[mesh] = (tile[0] * level.tile_m, tile[1] * level.tile_m, 0.0)
            self._low[mesh] = corners.min(axis=0) + self._origins[mesh]
            self._high[mesh] = corners.max(axis=0) + self._origins[mesh]

    def _min_rock_m(self, level: Level) -> float:
        """Give the smallest rock of a level that has a mesh; smaller ones are in the texture."""
        return _ROCK_MIN_TEXELS * level.texel_m

    def _bake(self, shown: NDArray[np.bool_]) -> None:
        """Make the tiles that are in view and not yet in their slot."""
        for mesh in np.flatnonzero(shown[: len(self._levels) * _BLOCKS]):
            index, block = divmod(int(mesh), _BLOCKS)
            level, window = self._levels[index], self._window(index)
            tile = (window.first[0] + block % TILES, window.first[1] + block // TILES)
            slot = (tile[0] % TILES, tile[1] % TILES)
            if window.baked.get(slot) == tile:
                continue
            radiance = self._texture.bake(level, tile, self._min_rock_m(level))
            at = (slot[0] * level.texels, slot[1] * level.texels)
            self._scene.upload_tile(index, *at, pyramid(radiance))
            window.baked[slot] = tile

    def _gather_rocks(self) -> None:
        """Choose the rocks anew and upload their meshes and images."""
        levels = range(min(_ROCK_LEVELS, len(self._levels)))
        rocks = self._rocks.choose(
            [self._active(k) for k in levels],
            [self._min_rock_m(self._levels[k]) for k in levels],
            [self._levels[k].texel_m for k in levels],
            int(0.9 * self._rock_faces * GROUPS),
        )
        rocks, places = self._fill_atlas(rocks)
        centres = np.array([rock.corners.mean(axis=(0, 1))[:2] for rock in rocks]).reshape(-1, 2)
        weights = np.array([len(rock.corners) for rock in rocks], dtype=np.int64)
        for group, rows in enumerate(split_groups(centres, weights)):
            self._upload_group(group, [rocks[k] for k in rows], [places[k] for k in rows])

    def _fill_atlas(self, rocks: list[RockMesh]) -> tuple[list[RockMesh], list[Array]]:
        """Pack the rocks' images, and give the rocks that found a place with their corners'."""
        atlas = np.zeros((ATLAS, ATLAS), np.float32)
        kept, places = [], []
        spots = pack([len(rock.image) for rock in rocks], ATLAS)
        for rock, spot in zip(rocks, spots, strict=True):
            if spot is None:
                continue
            edge = len(rock.image)
            atlas[spot[1] : spot[1] + edge, spot[0] : spot[0] + edge] = rock.image
            kept.append(rock)
            places.append((rock.places * edge + spot) / ATLAS)
        self._scene.upload_tile(len(self._levels), 0, 0, pyramid(atlas))
        return kept, places

    def _upload_group(self, group: int, rocks: list[RockMesh], places: list[Array]) -> None:
        mesh = len(self._levels) * _BLOCKS + group
        if not rocks:
            self._low[mesh], self._high[mesh] = np.inf, -np.inf
            return
        corners = np.concatenate([rock.corners for rock in rocks]).reshape(-1, 3)
        corners = corners[: 3 * self._rock_faces]
        origin = np.floor(corners.mean(axis=0))
        texcoords = np.concatenate(places).reshape(-1, 2)[: 3 * self._rock_faces]
        kept = np.arange(self._rock_faces) < len(corners) // 3
        self._scene.upload_mesh(mesh, corners - origin, texcoords, kept)
        self._origins[mesh] = origin
        self._low[mesh], self._high[mesh] = corners.min(axis=0), corners.max(axis=0)

    def _in_view(self, eye: int, T_world_camera: SE3) -> NDArray[np.bool_]:
        """Tell which meshes' boxes reach into a slightly widened view."""
        pinhole = self._eyes[eye]
        full = self._high[:, 0] > self._low[:, 0]
        ends = np.stack([self._low, self._high])
        ends[:, ~full] = 0.0
        pick = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        points = np.stack([ends[pick[:, axis], :, axis] for axis in range(3)], axis=-1)
        p = (points - T_world_camera.translation) @ T_world_camera.rotation
        x, y, z = p[..., 0], p[..., 1], p[..., 2]
        f, m = pinhole.focal_px, _VIEW_MARGIN_PX
        left, right = -pinhole.cx_px - m, pinhole.width_px - pinhole.cx_px + m
        top, bottom = -pinhole.cy_px - m, pinhole.height_px - pinhole.cy_px + m
        beyond = [f * x < left * z, f * x > right * z, f * y < top * z, f * y > bottom * z, z < 0]
        return full & ~np.any([np.all(side, axis=0) for side in beyond], axis=0)
