"""The house stays as it was planned: import order, quarantine of libraries, size, names."""

import subprocess
import sys
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from tests import house_rules as rules

Rule = Callable[[str, str], list[str]]

KERNEL = "from lpet_sim.rng import stream\n@njit(cache=True)\ndef f():\n    return stream"
BREAKS: list[tuple[Rule, str, str]] = [
    (rules.import_order_breaks, "lpet_sim/terrain/x.py", "from lpet_sim.rover.scene import Scene"),
    (rules.import_order_breaks, "lpet_sim/recording/x.py", "import lpet_sim.evaluation.errors"),
    (rules.import_order_breaks, "estimators/x.py", "def f():\n    from lpet_sim import sensors"),
    (rules.import_order_breaks, "lpet_sim/vision/x.py", "from . import detect"),
    (rules.import_order_breaks, "lpet_sim/evaluation/x.py", "import estimators"),
    (rules.import_order_breaks, "lpet_sim/attic/x.py", ""),
    (rules.import_order_breaks, "lpet_sim/rng.py", "from lpet_sim.geometry import SE3"),
    (rules.quarantine_breaks, "lpet_sim/rover/drive.py", "import mujoco.viewer"),
    (rules.quarantine_breaks, "lpet_sim/recording/x.py", "def f():\n    import rerun as rr"),
    (rules.geometry_breaks, "lpet_sim/geometry/x.py", "import cv2"),
    (rules.randomness_breaks, "lpet_sim/x.py", "import random"),
    (rules.randomness_breaks, "lpet_sim/x.py", "np.random.seed(1)"),
    (rules.randomness_breaks, "lpet_sim/x.py", "rng = np.random.default_rng(1)"),
    (rules.randomness_breaks, "lpet_sim/x.py", "from numpy.random import default_rng"),
    (rules.print_breaks, "lpet_sim/x.py", "def f():\n    print(1)"),
    (rules.print_breaks, "lpet_sim/x.py", "import matplotlib.pyplot as plt"),
    (rules.name_breaks, "lpet_sim/x.py", "def get_pose(): ..."),
    (rules.name_breaks, "lpet_sim/x.py", "class RunManager: ..."),
    (rules.name_breaks, "lpet_sim/utils.py", ""),
    (rules.seed_breaks, "lpet_sim/x.py", "class A(Spec):\n    seed: int = 0"),
    (rules.quaternion_breaks, "lpet_sim/x.py", "from scipy.spatial.transform import Rotation"),
    (rules.kernel_breaks, "lpet_sim/x.py", KERNEL),
    (rules.covariance_breaks, "estimators/x.py", "P[:3, :3] = 0"),
    (rules.covariance_breaks, "estimators/x.py", "self.covariance -= K @ H"),
]
RULES = list(dict.fromkeys(rule for rule, _, _ in BREAKS))
HEAVY = ("mujoco", "ompl", "cv2", "rerun", "trimesh", "rasterio", "gtsam", "distributed")


@pytest.fixture(scope="module")
def sources() -> dict[str, str]:
    """Read the product once."""
    return rules.sources()


@pytest.mark.parametrize(("rule", "path", "text"), BREAKS)
def test_each_rule_finds_a_file_that_breaks_it(rule: Rule, path: str, text: str) -> None:
    """A rule that finds nothing proves nothing."""
    assert rule(path, text)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_the_product_keeps_the_rules_of_the_house(rule: Rule, sources: dict[str, str]) -> None:
    """Import order, quarantine, randomness by name, and the rest; the command line may print."""
    exempt = {rules.print_breaks: "lpet_sim/cli.py", rules.randomness_breaks: "lpet_sim/rng.py"}
    files = {path: text for path, text in sources.items() if path != exempt.get(rule)}
    if rule is rules.geometry_breaks:
        files = {path: text for path, text in files.items() if "/geometry/" in path}
    assert [line for path, text in files.items() for line in rule(path, text)] == []


def test_every_room_is_walked(sources: dict[str, str]) -> None:
    """The checker reads what there is to read."""
    rooms = {rules.room_of(rules.module_of(path)) for path in sources}
    assert rooms >= {"foundation", "geometry", "recording", "evaluation", "terrain", "estimators"}


def test_no_room_can_import_itself_through_another() -> None:
    """The import order has no cycle."""
    reached: dict[str, set[str]] = {}
    for room, below in rules.MAY_IMPORT.items():
        reached[room] = set(below).union(*(reached[other] for other in below if other in reached))
        assert room not in reached[room]
        assert below <= reached.keys()


def test_functions_are_short(sources: dict[str, str]) -> None:
    """Median at most 8 lines, nine of ten at most 25, none over 50, docstrings apart."""
    lengths = {
        (path, *where): length
        for path, text in sources.items()
        for where, length in rules.body_lengths(text).items()
    }
    assert {where: n for where, n in lengths.items() if n > 50} == {}
    assert np.median(list(lengths.values())) <= 8
    assert np.percentile(list(lengths.values()), 90) <= 25


def test_the_length_of_a_function_leaves_its_docstring_out() -> None:
    """Two lines of body under a docstring of three."""
    text = 'def f():\n    """A.\n\n    B.\n    """\n    x = 1\n    return x\n'
    assert rules.body_lengths(text) == {(1, "f"): 2}


def test_files_are_short(sources: dict[str, str]) -> None:
    """At most 300 lines."""
    assert {p: n for p, text in sources.items() if (n := len(text.splitlines())) > 300} == {}


def test_tests_are_plain_functions_that_say_what_they_hold() -> None:
    """Each has a docstring, and no two files have the same name."""
    files = sorted((rules.ROOT / "tests").rglob("test_*.py"))
    twice = [name for name, n in Counter(path.name for path in files).items() if n > 1]
    assert twice == []
    bare = [
        f"{path.name}:{node.name}"
        for path in files
        for node in rules.ast.parse(path.read_text()).body
        if isinstance(node, rules.ast.ClassDef | rules.ast.FunctionDef)
        and node.name.lower().startswith("test")
        and (isinstance(node, rules.ast.ClassDef) or not rules.ast.get_docstring(node))
    ]
    assert bare == []


@pytest.mark.parametrize(
    ("modules", "absent"),
    [
        ("estimators, lpet_sim.evaluation.tables", HEAVY),
        ("lpet_sim.vision", tuple(name for name in HEAVY if name != "cv2")),
        ("lpet_sim.terrain.terrain", ("mujoco", "ompl", "cv2", "rerun")),
    ],
)
def test_a_room_runs_where_the_libraries_of_others_are_not_installed(
    modules: str, absent: tuple[str, ...]
) -> None:
    """Estimators without simulator, vision or viewer; vision without simulator."""
    block = "; ".join(f"sys.modules[{name!r}] = None" for name in absent)
    code = f"import sys; {block}; import {modules}"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=rules.ROOT
    )
    assert done.returncode == 0, done.stderr
