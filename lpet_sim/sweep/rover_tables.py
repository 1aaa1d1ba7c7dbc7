"""Tables of what was found out about a rover."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich.table import Table
from rich.text import Text

from lpet_sim.sweep.rover_check import DRIVEN_M, PARKED_RAD, PARKED_S, RoverCheck


def rover_tables(check: RoverCheck) -> Iterator[Table]:
    """Make the tables of a check: the rover, its wheels, and what it did."""
    yield _facts(f"rover {check.rover.model}", _rover_facts(check))
    yield _wheels(check)
    yield _facts("what it did", _deeds(check))


def _facts(title: str, rows: Iterator[tuple[str, str]]) -> Table:
    table = Table(title=title)
    table.add_column("quantity")
    table.add_column("value", justify="right")
    for quantity, value in rows:
        table.add_row(Text(quantity), Text(value))
    return table


def _rover_facts(check: RoverCheck) -> Iterator[tuple[str, str]]:
    frames, mobility, steering = check.frames, check.mobility, check.steering
    x, y, z = (float(part) for part in frames.T_body_camera.translation)
    yield "mass [kg]", f"{frames.mass_kg:.1f}"
    yield "gravity [m/s2]", f"{frames.gravity_mps2:g}"
    yield "wheels", f"{len(frames.wheel_names)}, {int(steering.steered.sum())} of them steered"
    yield "wheel radius, width [m]", f"{frames.wheel_radius_m:g}, {frames.wheel_width_m:g}"
    yield "height of the body's origin [m]", f"{frames.ride_height_m:.3f}"
    yield "ground clearance [m]", f"{check.clearance_m:.3f}"
    yield "footprint: front, rear [m]", f"{mobility.front_m:.3f}, {mobility.rear_m:.3f}"
    yield "footprint: half width [m]", f"{mobility.half_width_m:.3f}"
    yield "tightest arc [m]", f"{1 / steering.max_curvature:.2f}"
    yield "turns on the spot", steering.why_no_point_turn() or _how_it_turns(check)
    yield "left eye in the body [m]", f"{x:.3f}, {y:.3f}, {z:.3f}"
    yield "looks down by [deg]", f"{math.degrees(_pitch_down_rad(check)):.1f}"
    joints = ", ".join(name.removeprefix("own/") for name in frames.suspension_joints)
    yield "suspension joints", joints or "none"


def _how_it_turns(check: RoverCheck) -> str:
    return "by skidding" if check.steering.skids else "yes"


def _pitch_down_rad(check: RoverCheck) -> float:
    ahead = check.frames.T_body_camera.rotation[:, 2]
    return math.asin(max(-1.0, min(1.0, -float(ahead[2]))))


def _wheels(check: RoverCheck) -> Table:
    table = Table(title="wheels, in their order")
    for heading in ("wheel", "x [m]", "y [m]", "z [m]", "steers by [deg]", "load at rest [N]"):
        table.add_column(Text(heading), justify="left" if heading == "wheel" else "right")
    frames = check.frames
    rows = zip(
        frames.wheel_names,
        frames.wheel_position_body_m,
        frames.steer_limit_rad,
        check.load_n,
        strict=True,
    )
    for name, (x, y, z), limit, load in rows:
        steers = f"{math.degrees(limit):.0f}" if limit > 0 else "-"
        table.add_row(name, f"{x:+.3f}", f"{y:+.3f}", f"{z:+.3f}", steers, f"{load:.1f}")
    return table


def _deeds(check: RoverCheck) -> Iterator[tuple[str, str]]:
    slope = math.degrees(PARKED_RAD)
    yield "tilt at rest on the level [deg]", f"{math.degrees(check.tilt_rad):.2f}"
    yield f"moved, parked {PARKED_S:g} s on {slope:.0f} deg [mm]", f"{1e3 * check.crept_m:.2f}"
    yield f"drove, of {DRIVEN_M:g} m [m]", f"{check.driven_m:.3f}"
    yield "strayed to the left [mm]", f"{1e3 * check.aside_m:+.1f}"
    yield "mean slip [%]", f"{100 * check.slip:.2f}"
    yield "the drive ended", check.ending.kind
