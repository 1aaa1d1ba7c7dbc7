"""Python estimators that are not ours: found by entry point, run in a process of their own."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from importlib.machinery import PathFinder
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Final, cast

from pydantic import create_model

import lpet_sim
from lpet_sim.errors import EstimatorFaultError, SpecError
from lpet_sim.failures import MALFORMED, NO_OUTPUT
from lpet_sim.plugins.accept import accepted
from lpet_sim.plugins.child import ESTIMATE, FAULT
from lpet_sim.plugins.handover import read_estimate, write_measurements
from lpet_sim.plugins.limits import LimitSpec
from lpet_sim.plugins.supervise import Confinement, supervise
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements

GROUP: Final = "lpet.estimators"
_HERE: Final = Path(lpet_sim.__file__).resolve().parents[1]
_DESCRIBE_S: Final = 60.0


class PluginSpec(LimitSpec):
    """Limits of a Python plug-in; the parameters of its class stand beside them.

    Attributes:
        code: Digest of the plug-in's source, filled in: rows of a sweep hang on it.
    """

    code: str = ""


@dataclass(frozen=True)
class Description:
    """What a plug-in's class says of itself.

    Attributes:
        value: Where it is, ``module:Class``.
        needs: The streams without which it cannot run.
        spec: The type of its spec: its parameters and `PluginSpec`.
    """

    value: str
    needs: tuple[str, ...]
    spec: type[PluginSpec]


def plugin_names() -> dict[str, str]:
    """Give the plug-ins that are installed: names and where they are, ``module:Class``."""
    return {point.name: point.value for point in entry_points(group=GROUP)}


def describe(name: str) -> Description:
    """Ask a plug-in's class, in a process of its own, what it is; again if it was changed.

    Args:
        name: Of an entry point, or ``module:Class`` of a class that can be imported from here.

    Raises:
        SpecError: It cannot be imported, or is no estimator.
    """
    value = plugin_names().get(name, name)
    return _described(name, value, _digest(value))


@cache
def _described(name: str, value: str, code: str) -> Description:
    with tempfile.TemporaryDirectory(prefix="lpet-") as made:
        home = Path(made)
        answer, work = home / "work" / "answer.json", home / "work"
        work.mkdir()
        limits = LimitSpec(time_limit_s=_DESCRIBE_S)
        try:
            _supervised(["describe", value, str(answer)], value, work, limits)
        except EstimatorFaultError as fault:
            raise SpecError(f"estimator '{name}' ({value}) cannot be asked: {fault}") from None
        told = json.loads(answer.read_text())
    if "fault" in told:
        raise SpecError(f"estimator '{name}' ({value}): {told['fault']['text']}")
    return Description(value, tuple(told["needs"]), _spec_type(name, told["parameters"], code))


def _spec_type(name: str, parameters: dict[str, Any], code: str) -> type[PluginSpec]:
    """Make the type of a plug-in's spec of the parameters of its class."""
    taken = set(PluginSpec.model_fields) & set(parameters)
    if taken:
        names = ", ".join(sorted(taken))
        raise SpecError(f"estimator '{name}': rename its parameter {names}, which LPET has itself")
    fields: dict[str, Any] = {key: (Any, default) for key, default in parameters.items()}
    fields["code"] = (str, code)
    made = create_model(f"{name.replace(':', '.')}Spec", __base__=PluginSpec, **fields)
    return cast("type[PluginSpec]", made)


def plugin_code(name: str) -> str:
    """Name the source of a plug-in as it is now."""
    return _digest(plugin_names().get(name, name))


def plugin_builder(name: str) -> Callable[[PluginSpec], PythonPlugin]:
    """Give what builds a plug-in from its spec."""
    return lambda spec: PythonPlugin(name, spec)


@dataclass(frozen=True)
class PythonPlugin:
    """A Python estimator that is not ours.

    Attributes:
        name: The name under which results are reported.
        spec: Its parameters and limits.
    """

    name: str
    spec: PluginSpec

    @property
    def needs(self) -> tuple[str, ...]:
        """The streams without which it cannot run."""
        return describe(self.name).needs

    def estimate(self, measurements: Measurements) -> Estimate:
        """Run it on the measurements, in a process that has nothing else; see `Estimator`.

        Raises:
            EstimatorFaultError: It went wrong, one way or another.
            RecordingError: A stream that it needs is absent.
        """
        told = describe(self.name)
        measurements.require(*told.needs)
        with tempfile.TemporaryDirectory(prefix="lpet-") as made:
            work = Path(made) / "work"
            (work / "measurements").mkdir(parents=True)
            write_measurements(measurements, work / "measurements", "images" in told.needs)
            task = work / "task.json"
            task.write_text(json.dumps(self._task(told.value, work)))
            _supervised(["run", told.value, str(task)], told.value, work, self.spec)
            return accepted(self._estimate_in(work), measurements)

    def _task(self, value: str, work: Path) -> dict[str, Any]:
        own = set(PluginSpec.model_fields)
        mapping = self.spec.to_mapping()
        seen = _confinement(value)
        system = [sys.prefix, sys.base_prefix, "/usr", "/lib", "/lib64", "/etc", "/proc", "/dev"]
        allowed = [*system, "/sys", str(work), *seen.readable, *seen.writable, *self.spec.readable]
        return {
            "parameters": {k: v for k, v in mapping.items() if k not in own},
            "allowed": allowed,
            "listable": list(seen.listable),
        }

    def _estimate_in(self, work: Path) -> Estimate:
        fault, path = work / FAULT, work / ESTIMATE
        if fault.exists():
            told = json.loads(fault.read_text())["fault"]
            raise EstimatorFaultError(told["kind"], told["text"])
        if not path.exists():
            raise EstimatorFaultError(NO_OUTPUT, "it ended without an estimate")
        try:
            return read_estimate(self.name, path)
        except (ValueError, OSError, EOFError) as error:
            raise EstimatorFaultError(MALFORMED, f"its estimate cannot be read: {error}") from None


def _supervised(words: list[str], value: str, work: Path, limits: LimitSpec) -> None:
    """Run the child in a folder."""
    command = [sys.executable, "-u", "-B", "-m", "lpet_sim.plugins.child", *words]
    supervise(command, work, limits, _confinement(value), _environment(work))


def _environment(work: Path) -> dict[str, str]:
    """Give the child's variables: none that tells where recordings are."""
    kept = ("PATH", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "NUMBA_CACHE_DIR")
    threads = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    variables = {name: os.environ[name] for name in (*kept, *threads) if name in os.environ}
    path = os.pathsep.join(search_path())
    return variables | {"PYTHONPATH": path, "TMPDIR": str(work), "HOME": str(work)}


def search_path() -> list[str]:
    """Give where modules are looked for: as here, and in the folder where LPET was started."""
    return list(dict.fromkeys(str(Path(place or ".").resolve()) for place in [*sys.path, "."]))


def _confinement(value: str) -> Confinement:
    """Let the child see its own code, ours, and the names in the folders that modules lie in."""
    source = [str(path) for path in _sources(value)]
    ours = [str(_HERE / name) for name in ("lpet_sim", "estimators")]
    kernels = [str(_HERE / "lpet_sim" / "__pycache__"), os.environ.get("NUMBA_CACHE_DIR", "")]
    writable = tuple(place for place in kernels if place)
    return Confinement((*source, *ours, *_metadata()), tuple(search_path()), writable)


def _metadata() -> list[str]:
    """Give what says which packages are installed: libraries look for their own plug-ins there."""
    places = [Path(place) for place in search_path()]
    kinds = ("*.dist-info", "*.egg-info")
    return [str(found) for place in places for kind in kinds for found in place.glob(kind)]


def _sources(value: str) -> list[Path]:
    """Give the folder of the package, or the file of the module, in which a plug-in lies."""
    top = value.partition(":")[0].partition(".")[0]
    spec = PathFinder.find_spec(top, search_path()) or importlib.util.find_spec(top)
    if spec is None:
        raise SpecError(
            f"there is no module '{top}': install it, or run where {top}.py lies; an estimator is "
            "named by its entry point or as module:Class"
        )
    places: Iterable[str] = spec.submodule_search_locations or [spec.origin or ""]
    return [Path(place).resolve() for place in places if place]


def _digest(value: str) -> str:
    """Name the source of a plug-in."""
    found = hashlib.sha256(value.encode())
    for place in _sources(value):
        files = sorted(place.rglob("*.py")) if place.is_dir() else [place]
        for path in files:
            found.update(path.read_bytes())
    return found.hexdigest()[:16]
