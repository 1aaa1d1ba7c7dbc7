"""Small recordings with wheels and sightings but without physics, and sweeps over them."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from estimators.motion import integrate
from lpet_sim.geometry import SE3
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import Measurements, SightingStream, concatenate_slices
from lpet_sim.recording.truth import BodyTruth, Event, Truth
from lpet_sim.recording.writer import write_recording
from lpet_sim.rng import stream
from lpet_sim.sweep.sweep_store import TIMING, Row
from tests.estimators.stereo_traverse import stereo
from tests.estimators.traverses import calibration, readings, rolling_wheels, ticks

SPEED_MPS, YAW_RATE_RADPS, DURATION_S = 0.1, 0.02, 30.0
IMAGE_PERIOD_S = 1.0


def write_tiny(path: Path, seed: int, ended: str = "goal", duration_s: float = DURATION_S) -> Path:
    """Write an arc of 3 m on flat ground, with an image a second and wheels without slip."""
    t_ns = ticks(round(duration_s * 100) + 1, 100.0)
    turn = np.array([SPEED_MPS, 0, 0, 0, 0, YAW_RATE_RADPS]) / 100.0
    poses = integrate(SE3.identity(), np.tile(turn, (len(t_ns) - 1, 1)))
    still = np.zeros((len(t_ns), 3))
    end = Event(int(t_ns[-1]), ended, ends=True)
    truth = Truth(BodyTruth(t_ns, poses, still, still), None, (end,))
    wheels = readings(rolling_wheels(t_ns[::5].copy(), SPEED_MPS * 1.02, YAW_RATE_RADPS))
    declared = calibration(stereo=stereo())
    measurements = Measurements(declared, wheels=wheels, sightings=_sighted(truth, seed))
    write_recording(path, Recording(Manifest("made up", seed), measurements, truth))
    return path


def _sighted(truth: Truth, seed: int) -> SightingStream:
    rng = stream(seed, "tiny", "sightings")
    camera = stereo()
    p_world = rng.uniform([-2.0, -5.0, 0.0], [10.0, 8.0, 0.4], (600, 3))
    t_ns = truth.body.t_ns[:: round(100 * IMAGE_PERIOD_S)].copy()
    ids, rows = [], []
    for pose in truth.trajectory.at(t_ns):
        p_camera = (pose @ camera.T_body_camera.se3()).inverse() @ p_world
        px = np.full((len(p_world), 3), -1.0)
        near = (p_camera[:, 2] > 1.0) & (p_camera[:, 2] < 9.0)
        px[near] = camera.project(p_camera[near])
        inside = np.flatnonzero(np.all((px > 0) & (px < 1023), axis=1))[:25]
        ids.append(inside.astype(np.int64))
        rows.append(px[inside] + 0.3 * rng.standard_normal((len(inside), 3)))
    px = np.concatenate(rows)
    return SightingStream(
        t_ns, concatenate_slices(ids), np.concatenate(ids), px, np.full(len(px), 0.3)
    )


def small_sweep(folder: Path, **more: Any) -> dict[str, Any]:
    """Give a sweep over the recordings of a folder: two arms, three variants."""
    mapping: dict[str, Any] = {
        "name": "tiny",
        "data_sets": {"recordings": [str(folder / "*.rrd")]},
        "arms": {"recorded": None, "biased": {"declared": {"disparity_bias_px": 0.2}}},
        "variants": [
            {"estimator": "dead_reckoning"},
            {"estimator": "slam", "sweep": {"retention.images": [2, 4]}},
        ],
        "evaluation": {"segment_lengths_m": [1, 2, 50]},
    }
    return mapping | more


def write_sweep(path: Path, mapping: dict[str, Any]) -> Path:
    """Write a sweep as YAML."""
    path.write_text(yaml.safe_dump(mapping, sort_keys=False))
    return path


def without_timing(rows: Iterable[Row]) -> list[str]:
    """Give rows as text to the bit, NaN equal to NaN, without the columns that may differ."""
    return [json.dumps({k: v for k, v in row.items() if k not in TIMING}) for row in rows]


def events(folder: Path) -> list[dict[str, Any]]:
    """Give every whole event of a sweep's journals."""
    texts = [path.read_text() for path in sorted((folder / "journal").glob("*.jsonl"))]
    return [json.loads(line) for text in texts for line in text.split("\n")[:-1]]
