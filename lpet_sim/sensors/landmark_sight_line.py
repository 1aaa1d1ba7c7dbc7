"""Whether a line of sight is free: compiled walks over the ground's heights and among the rocks."""

from __future__ import annotations

import math

from numba import njit

GROUND_TOLERANCE_M = 0.01
"""By how much the grid may stand above a line of sight that is free: its own error [m]."""

FAR_TOLERANCE_RAD = 1e-3
"""The same for far landmarks as an angle [rad]: the coarser grids' error, under a pixel."""

_NEAR_END_M = 0.05  # of the line at the landmark: it lies on the ground itself
_FAR_END = 0.02  # the same for far landmarks, over the distance
_ROCK_END_M = 1e-3  # of the line, at both ends, in which no facet is counted


@njit(cache=True, nogil=True)
def ground_height(levels, z, k, x, y):  # type: ignore[no-untyped-def]
    """Interpolate the height of the ground between the four nodes of a level around a point."""
    level = levels[k]
    nx, ny = int(level[3]), int(level[4])
    fx, fy = (x - level[0]) / level[2], (y - level[1]) / level[2]
    ix = min(max(int(fx), 0), nx - 2)
    iy = min(max(int(fy), 0), ny - 2)
    fx, fy = fx - ix, fy - iy
    at = int(level[5]) + iy * nx + ix
    low = z[at] + fx * (z[at + 1] - z[at])
    high = z[at + nx] + fx * (z[at + nx + 1] - z[at + nx])
    return low + fy * (high - low)


@njit(cache=True, nogil=True)
def hidden_by_ground(levels, z, eye, p, far):  # type: ignore[no-untyped-def]
    """Walk from the eye to a landmark and see whether the ground comes between.

    A surface no steeper than S that is c below a line falling at s cannot meet it within
    ``c / (S + s)``: so far each step may go.

    Args:
        levels: As in `Occluders`.
        z: Likewise.
        eye: Where the line begins [m], Shape (3,).
        p: The landmark [m], Shape (3,).
        far: Whether the landmark is far.
    """
    dx, dy, dz = p[0] - eye[0], p[1] - eye[1], p[2] - eye[2]
    reach = math.sqrt(dx * dx + dy * dy)
    if reach < 1e-9:
        return False
    fall = max(0.0, -dz / reach)
    end = reach - (_FAR_END * reach if far else _NEAR_END_M)
    k, h = 0, 0.0
    while h < end:
        while h > levels[k, 6] and k < len(levels) - 1:
            k += 1
        t = h / reach
        ground = ground_height(levels, z, k, eye[0] + t * dx, eye[1] + t * dy)
        clear = eye[2] + t * dz - ground
        if clear < -(GROUND_TOLERANCE_M + (FAR_TOLERANCE_RAD * h if far else 0.0)):
            return True
        h += max(0.5 * levels[k, 2], clear / (levels[k, 7] + fall + 1e-9))
    return False


@njit(cache=True, nogil=True)
def _meets_rock(rock, planes, first, last, eye, d, length):  # type: ignore[no-untyped-def]
    """Clip a line by the planes of a convex rock: whether a piece of it lies inside."""
    if min(eye[2], eye[2] + d[2]) > rock[4]:
        return False
    flat = d[0] * d[0] + d[1] * d[1]
    x, y = rock[0] - eye[0], rock[1] - eye[1]
    t = min(max((x * d[0] + y * d[1]) / max(flat, 1e-18), 0.0), 1.0)
    x, y = x - t * d[0], y - t * d[1]
    if x * x + y * y > rock[2] * rock[2]:
        return False
    t_in, t_out = _ROCK_END_M / length, 1.0 - _ROCK_END_M / length
    for i in range(first, last):
        n = planes[i]
        outside = n[0] * eye[0] + n[1] * eye[1] + n[2] * eye[2] - n[3]
        slope = n[0] * d[0] + n[1] * d[1] + n[2] * d[2]
        if slope < 0.0:
            t_in = max(t_in, -outside / slope)
        elif slope > 0.0:
            t_out = min(t_out, -outside / slope)
        elif outside > 0.0:
            return False
        if t_in >= t_out:
            return False
    return True


@njit(cache=True, nogil=True)
def _cell_exit(at, step, d, origin, cell, e):  # type: ignore[no-untyped-def]
    """Give the parameter at which a line leaves a row or column of cells."""
    if step == 0:
        return 2.0
    edge = origin + (at + (1 if step > 0 else 0)) * cell
    return (edge - e) / d


@njit(cache=True, nogil=True)
def hidden_by_rocks(  # type: ignore[no-untyped-def]
    rocks, plane_start, planes, grid, cell_start, cell_rocks, eye, p
):
    """Walk the cells of the index from the eye to a landmark and try the rocks of each.

    Args:
        rocks: As in `Occluders`, like all up to `cell_rocks`.
        plane_start: Likewise.
        planes: Likewise.
        grid: Likewise.
        cell_start: Likewise.
        cell_rocks: Likewise.
        eye: Where the line begins [m], Shape (3,).
        p: The landmark [m], Shape (3,).
    """
    d = (p[0] - eye[0], p[1] - eye[1], p[2] - eye[2])
    length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    nx, ny, cell = int(grid[3]), int(grid[4]), grid[2]
    ix, iy = math.floor((eye[0] - grid[0]) / cell), math.floor((eye[1] - grid[1]) / cell)
    step_x = 1 if d[0] > 0.0 else (-1 if d[0] < 0.0 else 0)
    step_y = 1 if d[1] > 0.0 else (-1 if d[1] < 0.0 else 0)
    t = 0.0
    while t < 1.0 and 0 <= ix < nx and 0 <= iy < ny:
        at = iy * nx + ix
        for e in range(cell_start[at], cell_start[at + 1]):
            k = cell_rocks[e]
            if _meets_rock(rocks[k], planes, plane_start[k], plane_start[k + 1], eye, d, length):
                return True
        tx = _cell_exit(ix, step_x, d[0], grid[0], cell, eye[0])
        ty = _cell_exit(iy, step_y, d[1], grid[1], cell, eye[1])
        t = min(tx, ty)
        if tx <= ty:
            ix += step_x
        else:
            iy += step_y
    return False
