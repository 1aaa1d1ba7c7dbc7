"""The rules of the house, read off the syntax trees: each gives the places that break it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from lpet_sim.kernel_cache import MARK

ROOT = Path(__file__).parents[1]
PACKAGES = ("lpet_sim", "estimators")

FOUNDATION = {
    "errors",
    "failures",
    "rng",
    "spec",
    "datasets",
    "outputs",
    "progress",
    "kernel_cache",
}
PHYSICAL = {"soil", "terrain", "rover", "sensors", "planning", "rig"}
MAY_IMPORT: dict[str, set[str]] = {
    "foundation": set(),
    "geometry": set(),
    "recording": {"foundation", "geometry"},
    "formats": {"foundation", "geometry", "recording"},
    "vision": {"foundation", "geometry", "recording"},
    "evaluation": {"foundation", "geometry", "recording"},
    "plugins": {"foundation", "geometry", "recording", "formats"},
    "estimators": {"foundation", "geometry", "recording", "evaluation", "plugins"},
    "soil": {"foundation", "geometry", "recording"},
    "terrain": {"foundation", "geometry", "recording", "soil"},
    "rover": {"foundation", "geometry", "recording", "soil", "terrain"},
    "sensors": {"foundation", "geometry", "recording", "soil", "terrain", "rover"},
    "planning": {
        "foundation",
        "geometry",
        "recording",
        "evaluation",
        "soil",
        "terrain",
        "rover",
    },
    "rig": {"foundation", "geometry", "recording", "soil", "terrain", "rover"},
}
MAY_IMPORT["terminal"] = {"foundation"}
MAY_IMPORT["sweep"] = {*MAY_IMPORT} - {"sweep"}
MAY_IMPORT["tradeoff"] = {*MAY_IMPORT}
MAY_IMPORT["study"] = {*MAY_IMPORT}
MAY_IMPORT["cli_rig"] = {*MAY_IMPORT} - {"study"}
MAY_IMPORT["cli_report"] = {*MAY_IMPORT} - {"study", "cli_rig"}
MAY_IMPORT["cli_estimator"] = {*MAY_IMPORT} - {"study", "cli_rig", "cli_report"}
MAY_IMPORT["cli_sweep"] = {*MAY_IMPORT} - {"study", "cli_rig"}
MAY_IMPORT["cli_formats"] = {*MAY_IMPORT} - {"study", "cli_rig", "cli_report", "cli_sweep"}
MAY_IMPORT["cli_reach"] = {*MAY_IMPORT} - {
    "study",
    "cli_rig",
    "cli_report",
    "cli_sweep",
    "cli_formats",
}
MAY_IMPORT["cli_tradeoff"] = MAY_IMPORT["cli_reach"]
MAY_IMPORT["cli_rover"] = MAY_IMPORT["cli_reach"]
MAY_IMPORT["cli_study"] = {*MAY_IMPORT} - {
    "cli_rig",
    "cli_report",
    "cli_sweep",
    "cli_formats",
    "cli_reach",
    "cli_tradeoff",
    "cli_rover",
}
MAY_IMPORT["cli"] = {*MAY_IMPORT}
"""Which rooms each room may import, besides itself."""

QUARANTINE: dict[str, set[str]] = {
    "mujoco": {
        "lpet_sim/rover/mjcf.py",
        "lpet_sim/rover/model_fit.py",
        "lpet_sim/rover/model_parts.py",
        "lpet_sim/rover/model_source.py",
        "lpet_sim/rover/picture.py",
        "lpet_sim/rover/scene.py",
        "lpet_sim/sensors/render_scene.py",
    },
    "ompl": {"lpet_sim/planning/route.py", "lpet_sim/planning/search.py"},
    "cv2": {"lpet_sim/vision/detect.py"},
    "rerun": {
        "lpet_sim/recording/store.py",
        "lpet_sim/recording/visuals.py",
        "lpet_sim/recording/blueprint.py",
    },
    "trimesh": {"lpet_sim/terrain/rock_shapes.py"},
    "rasterio": {"lpet_sim/terrain/dem.py"},
    "gtsam": {"estimators/peers/library.py"},
    "distributed": {"lpet_sim/sweep/sweep_pool.py"},
    "joblib": {"lpet_sim/sweep/sweep_pool.py"},
    "mcap": {"lpet_sim/formats/mcap_file.py"},
    "mcap_ros2": {"lpet_sim/formats/mcap_file.py"},
    "typer": {
        "lpet_sim/cli.py",
        "lpet_sim/cli_estimator.py",
        "lpet_sim/cli_formats.py",
        "lpet_sim/cli_reach.py",
        "lpet_sim/cli_report.py",
        "lpet_sim/cli_rig.py",
        "lpet_sim/cli_rover.py",
        "lpet_sim/cli_study.py",
        "lpet_sim/cli_sweep.py",
        "lpet_sim/cli_tradeoff.py",
    },
}
"""The files that may import a library, so that its upgrade touches one room."""

GEOMETRY_LIBRARIES = {
    "numpy",
    "scipy",
    "numba",
    "__future__",
    "collections",
    "dataclasses",
    "typing",
}
SEEDED = {"Generator", "PCG64", "BitGenerator", "SeedSequence"}
BANNED_NAMES = re.compile(r"^(get_|process_|handle_)|Manager$|^utils?$")
GAUSSIAN = ("estimators/gaussian.py", "estimators/gaussian_blocks.py")
COVARIANCE = re.compile(r"^(P|cov|covariance)(_\w+)?$")


def sources() -> dict[str, str]:
    """Give the text of every source file of the product by its path in the repository."""
    found = (path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py")))
    return {path.relative_to(ROOT).as_posix(): path.read_text() for path in found}


def room_of(module: str) -> str:
    """Give the room of a module such as ``lpet_sim.rover.scene``."""
    parts = module.split(".")
    if parts[0] == "estimators":
        return "estimators"
    name = parts[1] if len(parts) > 1 else "foundation"
    return "foundation" if name in FOUNDATION or name.startswith("__") else name


def module_of(path: str) -> str:
    """Give the module of a source file."""
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


def imports(text: str) -> Iterator[tuple[int, str]]:
    """Give line and full name of everything imported, wherever in the file the import stands."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level:
            yield node.lineno, "." * node.level
        elif isinstance(node, ast.ImportFrom):
            yield from ((node.lineno, f"{node.module}.{alias.name}") for alias in node.names)


def import_order_breaks(path: str, text: str) -> list[str]:
    """Find imports of a room that this file's room may not know, and relative ones."""
    room = room_of(module_of(path))
    if room not in MAY_IMPORT:
        return [f"{path}: room '{room}' has no place in the import order"]
    allowed = {room, *MAY_IMPORT[room]}
    ours = ((n, name) for n, name in imports(text) if name.split(".")[0] in (*PACKAGES, ""))
    return [f"{path}:{n} imports {name}" for n, name in ours if room_of(name) not in allowed]


def quarantine_breaks(path: str, text: str) -> list[str]:
    """Find imports of a quarantined library outside its files."""
    tops = ((n, name.split(".")[0]) for n, name in imports(text))
    return [
        f"{path}:{n} imports {top}" for n, top in tops if path not in QUARANTINE.get(top, {path})
    ]


def geometry_breaks(path: str, text: str) -> list[str]:
    """Find what geometry imports beyond numpy, scipy, their compiler numba and itself."""
    allowed = (*GEOMETRY_LIBRARIES, "lpet_sim")
    return [f"{path}:{n} imports {m}" for n, m in imports(text) if m.split(".")[0] not in allowed]


def randomness_breaks(path: str, text: str) -> list[str]:
    """Find generators that are not made by ``lpet_sim.rng.stream``, and the global ones."""
    found = [f"{path}:{n} imports {m}" for n, m in imports(text) if m.split(".")[0] == "random"]
    for node in ast.walk(ast.parse(text)):
        of_random = isinstance(node, ast.Attribute) and ast.unparse(node.value).endswith(".random")
        if of_random and ast.unparse(node.value) in ("np.random", "numpy.random"):
            assert isinstance(node, ast.Attribute)
            if node.attr not in SEEDED:
                found.append(f"{path}:{node.lineno} uses {ast.unparse(node)}")
    banned = (f"{path}:{n} imports {m}" for n, m in imports(text) if m.startswith("numpy.random."))
    return found + [line for line in banned if line.rsplit(".", 1)[1] not in SEEDED]


def print_breaks(path: str, text: str) -> list[str]:
    """Find calls of print, and pyplot, whose figures are global."""
    nodes = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.Call)]
    calls = [n.lineno for n in nodes if isinstance(n.func, ast.Name) and n.func.id == "print"]
    pyplot = [n for n, name in imports(text) if name.startswith("matplotlib.pyplot")]
    return [f"{path}:{n} prints" for n in calls] + [f"{path}:{n} imports pyplot" for n in pyplot]


def name_breaks(path: str, text: str) -> list[str]:
    """Find names that say nothing: get_, process_, handle_, Manager, utils."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    names = [(n.lineno, n.name) for n in ast.walk(ast.parse(text)) if isinstance(n, kinds)]
    names.append((1, Path(path).stem))
    return [f"{path}:{n} names {x}" for n, x in names if BANNED_NAMES.search(x.lstrip("_"))]


def seed_breaks(path: str, text: str) -> list[str]:
    """Find specs that hold a seed."""
    classes = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.ClassDef)]
    specs = [c for c in classes if any(ast.unparse(base).endswith("Spec") for base in c.bases)]
    fields = [f for c in specs for f in c.body if isinstance(f, ast.AnnAssign)]
    return [f"{path}:{f.lineno} holds a seed" for f in fields if "seed" in ast.unparse(f.target)]


def quaternion_breaks(path: str, text: str) -> list[str]:
    """Find SciPy's rotations, whose quaternions are scalar last, outside ``so3.py``."""
    if path == "lpet_sim/geometry/so3.py":
        return []
    found = (n for n, name in imports(text) if name.startswith("scipy.spatial.transform"))
    return [f"{path}:{n} imports SciPy's rotations" for n in found]


def covariance_breaks(path: str, text: str) -> list[str]:
    """Find estimators that write into a covariance outside the files that may."""
    if not path.startswith("estimators/") or path in GAUSSIAN:
        return []
    found = []
    for node in ast.walk(ast.parse(text)):
        targets = node.targets if isinstance(node, ast.Assign) else []
        written = [t.value for t in targets if isinstance(t, ast.Subscript)]
        written += [node.target] if isinstance(node, ast.AugAssign) else []
        names = (ast.unparse(target).split("[")[0].split(".")[-1] for target in written)
        found += [f"{path}:{node.lineno} writes {x}" for x in names if COVARIANCE.match(x)]
    return found


def kernel_breaks(path: str, text: str) -> list[str]:
    """Find names in compiled code from a file that does not mark itself as a part of it."""
    tree = ast.parse(text)
    origin = {
        alias.asname or alias.name: node.module.replace(".", "/")
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in PACKAGES
        for alias in node.names
        if node.module
    }
    kernels = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef)
        and any(MARK in ast.unparse(d) for d in node.decorator_list)
    ]
    used = {
        (n.lineno, n.id)
        for k in kernels
        for part in k.body
        for n in ast.walk(part)
        if isinstance(n, ast.Name)
    }
    return [
        f"{path}:{line} compiles {name}, whose file has no word '{MARK}'"
        for line, name in sorted(used)
        if name in origin and not _has_part_in_kernels(origin[name], name)
    ]


def _has_part_in_kernels(module: str, name: str) -> bool:
    files = (ROOT / f"{module}.py", ROOT / module / "__init__.py", ROOT / module / f"{name}.py")
    return any(MARK in file.read_text() for file in files if file.exists())


def body_lengths(text: str) -> dict[tuple[int, str], int]:
    """Give the lines of every function's body without its docstring, by line and name."""
    out = {}
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef):
            body = node.body[1:] if ast.get_docstring(node) is not None else node.body
            if body and ast.unparse(body[0]) != "...":
                out[node.lineno, node.name] = (body[-1].end_lineno or 0) - body[0].lineno + 1
    return out
