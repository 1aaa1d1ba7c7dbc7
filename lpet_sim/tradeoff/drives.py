"""One drive of the simulation: a recording carries a candidate, and estimators run on it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from estimators.odometry_steps import image_odometry
from lpet_sim.errors import LpetError
from lpet_sim.recording.reader import read_recording
from lpet_sim.sweep.carried import Carrier
from lpet_sim.sweep.sensing import terrain_of
from lpet_sim.sweep.sweep_job import bound_of
from lpet_sim.sweep.sweep_once import PlannedRun, RunSettings, Scene, run_row, said
from lpet_sim.sweep.sweep_store import Journal, RowStore
from lpet_sim.tradeoff.candidate import Candidate
from lpet_sim.tradeoff.kept_terrain import KeptTerrain
from lpet_sim.tradeoff.recommend import suite_of
from lpet_sim.tradeoff.spec import SiteSpec


@dataclass(frozen=True, slots=True)
class Drive:
    """One candidate on one recording with one draw: the variants run on the same measurements.

    Attributes:
        key: Names what its runs depend on.
        path: The recording.
        candidate: The sensor.
        site: Where it is used.
        draw: Seed of landmarks, noise and odometry.
        runs: The variants.
        settings: What all runs have in common.
        bound: Whether to compute the Cramer-Rao bound, too.
    """

    key: str
    path: Path
    candidate: Candidate
    site: SiteSpec
    draw: int
    runs: tuple[PlannedRun, ...]
    settings: RunSettings
    bound: bool = False


def missing_runs(drive: Drive, store: RowStore) -> list[PlannedRun]:
    """Give the runs of a drive of which there is no row yet, or all if its bound is missing."""
    lacking = set(store.missing([run.key for run in drive.runs], drive.settings.redo))
    if drive.bound and drive.key not in store.bounds:
        return list(drive.runs)
    return [run for run in drive.runs if run.key in lacking]


def run_drive(drive: Drive) -> int:
    """Run what is missing of a drive, and add each row as its run ends.

    Returns:
        How many runs were run.
    """
    drive.settings.find_modules()
    store = RowStore(drive.settings.folder).refresh(drive.key)
    todo = missing_runs(drive, store)
    if not todo:
        return 0
    scene: Scene | str
    try:
        scene = carried_scene(drive.path, drive.candidate, drive.site, drive.draw)
    except LpetError as error:
        scene = f"before the run: {said(error)}"
    with Journal(drive.settings.folder, drive.key) as journal:
        for run in todo:
            journal.start(run.key, drive.settings.driver)
            journal.row(run_row(run, scene, drive.settings))
        if drive.bound:
            journal.bound(drive.key, bound_of(scene))
    return len(todo)


def carried_scene(path: Path, candidate: Candidate, site: SiteSpec, draw: int) -> Scene:
    """Give what a candidate would have measured on a recorded drive, with odometry at its images.

    Args:
        path: The recording.
        candidate: The sensor.
        site: Landmarks, wheels and speed.
        draw: Seed of all draws.

    Raises:
        RecordingError: The recording cannot be used.
    """
    carrier = _carrier(path)
    landmarks = candidate.landmark_sensor(site.landmarks, site.speed_mps)
    measured = carrier.carry(suite_of(candidate, site), landmarks, draw)
    assert measured.sightings is not None
    odometry = image_odometry(measured, measured.sightings.t_ns)
    return Scene(replace(measured, odometry=odometry), carrier.truth, len(measured.sightings))


@lru_cache(maxsize=2)
def _carrier(path: Path) -> Carrier:
    recording = read_recording(path)
    terrain, seed = terrain_of(recording.manifest), recording.manifest.seed or 0
    return Carrier.of(recording, KeptTerrain(terrain.spec, seed))
