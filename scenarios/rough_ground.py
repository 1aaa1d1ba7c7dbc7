"""Wheels on flat, rough and rocky ground: slip, its time step, chatter, energy, and parking.

    python -m scenarios.rough_ground [--quick] [--out docs/results] [--workers 2]

Writes ``rough_ground.csv`` and ``rough_ground.md`` (a row for each ground and time step),
``parked.md`` and ``wheel_spectra.png``. The grounds have the soils of ``exomars``; each row is kept
in ``out/experiments`` as it ends, so a killed run goes on where it was.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import math
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np
from matplotlib.figure import Figure
from rich.progress import track
from scipy.signal import welch

from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.recording.arrays import Array
from lpet_sim.rig.bed import TiltBed
from lpet_sim.rover.drive import drive, start_of
from lpet_sim.rover.scene import Scene, build_scene
from lpet_sim.rover.spec import DriveSpec, RoverSpec
from lpet_sim.soil.load import load_soil
from lpet_sim.study.one_traverse import SCENARIOS
from lpet_sim.terrain.load import load_terrain_spec
from lpet_sim.terrain.spec import ReliefSpec, SoilClass, TerrainSpec
from lpet_sim.terrain.terrain import build_terrain

Row = dict[str, Any]

COMMAND: Final = "python -m scenarios.rough_ground"
SEED: Final = 1
CACHE: Final = Path("out/experiments")
GROUNDS: Final = ("flat", "rough", "rocks")
STEPS_S: Final = (0.005, 0.0025)
SPEED_MPS: Final = 0.05
PARKED_RAD: Final = math.radians(15.0)


def ground(kind: str) -> TerrainSpec:
    """Give the ground: the soils of exomars on the flat, with its relief, with rocks as well.

    Rocks of up to 0.15 m, so that the way can lead straight over them: with those of up to 0.25 m a
    wheel that pushes against one digs in after 2 m, which ends the drive as entrapped.
    """
    preset = load_terrain_spec("exomars")
    bare: Row = {"name": kind, "craters": None, "rocks": None, "far": None}
    if kind == "flat":
        bare["relief"] = ReliefSpec(rms_slope_rad=0.0)
    if kind == "rocks":
        assert preset.rocks is not None
        bare["rocks"] = preset.rocks.model_copy(update={"diameter_max_m": 0.15})
    return preset.model_copy(update=bare)


def slip_row(kind: str, dt_s: float, length_m: float) -> Row:
    """Drive straight on and sum up slip, sinkage and how the drive ended."""
    rover = RoverSpec(physics_dt_s=dt_s)
    spec = DriveSpec(waypoints_m=((0.0, 0.0), (length_m, 0.0)), speed_mps=SPEED_MPS)
    scene = build_scene(build_terrain(ground(kind), SEED), rover, *start_of(spec))
    slips, turns, sinkage, ended = [], [], [], ""
    before: Array | None = None
    for chunk in drive(scene, spec, chunk_s=20.0):
        wheels = chunk.wheels
        assert wheels is not None
        angle = wheels.drive_angle_rad if before is None else np.r_[before, wheels.drive_angle_rad]
        turns.append(np.diff(angle, axis=0))
        slips.append(wheels.slip[-len(turns[-1]) :])
        sinkage.append(wheels.sinkage_m)
        before = wheels.drive_angle_rad[-1:]
        ended = chunk.events[-1].kind if chunk.events else ended
    slip, turn, depth = np.concatenate(slips), np.concatenate(turns), np.concatenate(sinkage)
    return {
        "ground": kind,
        "dt_ms": 1e3 * dt_s,
        "length_m": length_m,
        "mean_slip_percent": 100 * float((slip * turn).sum() / turn.sum()),
        "std_slip_percent": 100 * float(_per_second(slip, turn, spec.wheel_rate_hz).std()),
        "mean_sinkage_mm": 1e3 * float(depth.mean()),
        "most_sinkage_mm": 1e3 * float(depth.max()),
        "ended": ended,
    }


def _per_second(slip: Array, turn: Array, rate_hz: float) -> Array:
    """Give each wheel's slip over each second, Shape (n, 6)."""
    n = round(rate_hz)
    whole = len(slip) // n * n
    lost = (slip * turn)[:whole].reshape(-1, n, 6).sum(axis=1)
    turned = turn[:whole].reshape(-1, n, 6).sum(axis=1)
    return np.where(np.abs(turned) > 1e-3, lost / np.where(turned == 0, 1.0, turned), 0.0)


def energy_row(kind: str, duration_s: float) -> Row:
    """Drive straight on and take the gain in energy from the motors' work, second by second."""
    scene = _driving(kind)
    losses, trace = [], []
    for _ in range(round(duration_s)):
        before, work = _energy_j(scene), 0.0
        for k in range(round(1.0 / scene.spec.physics_dt_s)):
            if k % 20 == 0:
                _command(scene)
            rate = scene.data.qvel.copy()
            scene.step()
            mean_rate = 0.5 * (rate + scene.data.qvel)
            work += float(scene.data.qfrc_actuator @ mean_rate) * scene.spec.physics_dt_s
            _, side_n, load_n, rate_radps = scene.contact.force  # as they are, not their means
            trace.append(np.concatenate([rate_radps, load_n, side_n]))
        losses.append(work - (_energy_j(scene) - before))
    return {
        "ground": kind,
        "least_loss_w": min(losses),
        "mean_loss_w": float(np.mean(losses)),
        "trace": np.round(np.array(trace), 5).tolist(),
    }


def _driving(kind: str) -> Scene:
    """Give a rover that has settled and drives."""
    scene = build_scene(build_terrain(ground(kind), SEED), RoverSpec())
    for k in range(2000):
        if k % 20 == 0 and k >= 1000:
            _command(scene)
        scene.step()
    return scene


def _command(scene: Scene) -> None:
    scene.follow()
    scene.command(np.zeros(6), np.full(6, SPEED_MPS / scene.frames.wheel_radius_m))


def _energy_j(scene: Scene) -> float:
    """Give kinetic and potential energy, of a copy brought up to the state."""
    data = mujoco.MjData(scene.model)
    data.qpos[:], data.qvel[:] = scene.data.qpos, scene.data.qvel
    mujoco.mj_fwdPosition(scene.model, data)
    mujoco.mj_fwdVelocity(scene.model, data)
    mujoco.mj_energyPos(scene.model, data)
    mujoco.mj_energyVel(scene.model, data)
    return float(data.energy.sum())


def parked_row(soil: str, heading: str, duration_s: float) -> Row:
    """Drive a little on a slope, stop, and see how far the parked rover moves."""
    terrain = TerrainSpec(soils=(SoilClass(name=soil, soil=load_soil(soil)),))
    azimuth = {"up": 0.0, "down": math.pi, "across": math.pi / 2}[heading]
    scene = build_scene(TiltBed(terrain, PARKED_RAD, azimuth), RoverSpec())
    rate = 0.03 / scene.frames.wheel_radius_m
    place = np.zeros(3)
    for second in range(round(duration_s) + 10):
        if second == 10:
            place = scene.body_row()[:3]
        turning = rate if 2 <= second < 5 else 0.0
        scene.command(np.zeros(6), np.full(6, turning))
        for _ in range(round(1.0 / scene.spec.physics_dt_s)):
            scene.step()
    moved = float(np.linalg.norm(scene.body_row()[:3] - place))
    return {"soil": soil, "heading": heading, "minutes": duration_s / 60, "moved_mm": 1e3 * moved}


def draw_spectra(rows: list[Row], path: Path) -> None:
    """Draw spectra of wheel rate, load and side force on each ground."""
    figure = Figure(figsize=(12, 4), layout="constrained")
    names = ("wheel rate [(rad/s)²/Hz]", "load [N²/Hz]", "side force [N²/Hz]")
    for part, (axes, name) in enumerate(zip(figure.subplots(1, 3), names, strict=True)):
        for row in rows:
            trace = np.array(row["trace"])[:, 6 * part : 6 * part + 6]
            frequency, power = welch(trace, 1.0 / STEPS_S[0], nperseg=min(1024, len(trace)), axis=0)
            axes.loglog(frequency[1:], power[1:].mean(axis=1), label=row["ground"], lw=1.2)
        axes.set(xlabel="frequency [Hz]", title=name)
        axes.grid(alpha=0.3, which="both")
    figure.axes[0].legend()
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=110, format="png")


def _kept(name: str, work: Callable[..., Row], *values: Any) -> Row:
    """Do a piece of work once; its row is kept under what it hangs on, code and all."""
    digest = hashlib.sha256(json.dumps(values).encode())
    for path in sorted((SCENARIOS.parent / "lpet_sim").rglob("*.py")):
        digest.update(path.read_bytes())
    digest.update((SCENARIOS.parent / "models" / "exomars.xml").read_bytes())
    digest.update(Path(__file__).read_bytes())
    path = output_folder(CACHE) / f"{name}_{digest.hexdigest()[:12]}.json"
    if not path.exists():
        row = work(*values)
        with whole_file(path) as temporary:
            temporary.write_text(json.dumps(row))
    return dict(json.loads(path.read_text()))


def markdown(slips: list[Row], energies: list[Row]) -> list[str]:
    """Write what was measured on each ground."""
    lines = [
        "# Rough ground",
        "",
        f"`{COMMAND}`, seed {SEED}; straight over {slips[0]['length_m']:g} m of the soils of "
        f"`exomars` at {100 * SPEED_MPS:g} cm/s: flat, with its relief, with rocks of up to 0.15 m "
        "as well. Slip is weighted by the wheels' turn; its scatter is that of each wheel over "
        "each second.",
        "",
        "| ground | step [ms] | mean slip [%] | scatter [%] | sinkage, mean, most [mm] | ended |",
        "|---|---|---|---|---|---|",
    ]
    for row in slips:
        depth = f"{row['mean_sinkage_mm']:.1f}, {row['most_sinkage_mm']:.1f}"
        lines.append(
            f"| {row['ground']} | {row['dt_ms']:g} | {row['mean_slip_percent']:.2f} | "
            f"{row['std_slip_percent']:.1f} | {depth} | {row['ended']} |"
        )
    lines += [
        "",
        "Motors' work less the gain in kinetic and potential energy, over each second [W]; below 0 "
        "energy would be made:",
        "",
        "| ground | least | mean |",
        "|---|---|---|",
    ]
    energy = "| {ground} | {least_loss_w:.3f} | {mean_loss_w:.3f} |"
    return [*lines, *(energy.format(**row) for row in energies)]


def parked_markdown(rows: list[Row]) -> list[str]:
    """Write how far parked rovers move."""
    lines = [
        "# Parked",
        "",
        f"`{COMMAND}`; parked on {math.degrees(PARKED_RAD):g} deg for {rows[0]['minutes']:.2g} "
        "minutes after 9 cm of driving.",
        "",
        "| soil | heading | moved [mm] |",
        "|---|---|---|",
    ]
    return lines + [f"| {r['soil']} | {r['heading']} | {r['moved_mm']:.3f} |" for r in rows]


def main() -> None:
    """Run every piece over the workers and write tables and figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, help="docs/results; out/experiments with --quick")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="centimetres, and seconds of parking")
    options = parser.parse_args()
    length_m, drive_s, park_s = (0.3, 2.0, 2.0) if options.quick else (50.0, 60.0, 600.0)
    grounds = ("rocks",) if options.quick else GROUNDS
    soils = ("grc1_loose",) if options.quick else ("grc1_loose", "mars_regolith")
    work: list[tuple[Any, ...]] = [
        *(("slip", slip_row, kind, dt, length_m) for kind in grounds for dt in STEPS_S),
        *(("energy", energy_row, kind, drive_s) for kind in grounds),
        *(("parked", parked_row, soil, way, park_s) for soil in soils for way in ("up", "down")),
        *(("parked", parked_row, soil, "across", park_s) for soil in soils),
    ]
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
        futures = [pool.submit(_kept, *piece) for piece in work]
        done = [future.result() for future in track(futures, "driving")]
    rows = {name: [r for r, w in zip(done, work, strict=True) if w[0] == name] for name, *_ in work}
    _write(rows, output_folder(options.out or (CACHE if options.quick else Path("docs/results"))))


def _write(rows: dict[str, list[Row]], folder: Path) -> None:
    names = list(rows["slip"][0])
    with whole_file(folder / "rough_ground.csv") as temporary, temporary.open("w") as file:
        writer = csv.DictWriter(file, names, lineterminator="\n")
        writer.writeheader()
        short = (
            {k: f"{v:.5g}" if isinstance(v, float) else v for k, v in r.items()}
            for r in rows["slip"]
        )
        writer.writerows(short)
    texts = {
        "rough_ground.md": markdown(rows["slip"], rows["energy"]),
        "parked.md": parked_markdown(rows["parked"]),
    }
    for name, lines in texts.items():
        with whole_file(folder / name) as temporary:
            temporary.write_text("\n".join(lines) + "\n")
        print("\n".join(lines))
    draw_spectra(rows["energy"], folder / "wheel_spectra.png")
    for name in ("rough_ground.csv", *texts, "wheel_spectra.png"):
        print(f"wrote {folder / name}")


if __name__ == "__main__":
    main()
