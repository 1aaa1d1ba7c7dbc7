"""Estimators in other languages: what they do, and what comes of those that go wrong."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimators import build_estimator
from lpet_sim.errors import EstimatorFaultError, SpecError
from lpet_sim.plugins.program import ProgramSpec
from lpet_sim.recording.reader import read_measurements
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.sweep.sweep_run import run_sweep
from lpet_sim.sweep.sweep_spec import SweepSpec
from tests.formats.samples import small
from tests.plugins.examples import EXAMPLES, straight
from tests.sweep.tiny_recordings import write_tiny

GIVEN = ("{measurements}", "{estimate}")
LIMITS = {"time_limit_s": 30.0, "memory_limit_mib": 500, "output_limit_mib": 20}
GOOD = "1000000.0 0 0 0 0 0 0 1\n1000001.0 0.1 0 0 0 0 0 1\n"


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a recording of three metres."""
    return write_tiny(tmp_path_factory.mktemp("truths") / "tiny.rrd", 1)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compile the example in C."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("there is no C compiler 'cc'")
    made = tmp_path_factory.mktemp("c") / "straight"
    told = [compiler, "-O2", "-Wall", "-Werror", "-o", str(made), str(EXAMPLES / "straight.c")]
    subprocess.run([*told, "-lm"], check=True)
    return made


def test_a_program_in_c_estimates_as_the_same_in_python_does(
    recording: Path, program: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each pose to the last digits, and each time to the nanosecond."""
    measurements = read_measurements(recording)
    built = build_estimator("program", {"command": [str(program), *GIVEN], **LIMITS})
    found = built.estimate(measurements).trajectory
    here = straight(monkeypatch)().estimate(measurements).trajectory
    assert np.array_equal(found.t_ns, here.t_ns)
    off = found.T_world_body.translation - here.T_world_body.translation
    assert np.abs(off).max() < 1e-12


def test_examples_of_both_kinds_run_in_a_sweep_beside_our_own(
    recording: Path, program: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The Python one by an entry point as a package has it, the other by its command."""
    about = tmp_path / "mine-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[lpet.estimators]\nmine = straight:Straight\n")
    shutil.copy(EXAMPLES / "straight.py", tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    mapping: dict[str, Any] = {
        "name": "both",
        "data_sets": {"recordings": [str(recording)]},
        "variants": [
            {"estimator": "dead_reckoning"},
            {"estimator": "mine", "sweep": {"scale": [1.0, 0.5]}},
            {"estimator": "program", "name": "c", "spec": {"command": [str(program), *GIVEN]}},
        ],
    }
    rows = run_sweep(SweepSpec.from_mapping(mapping), tmp_path / "out", Pool(1)).rows
    ends = {row["variant"]: row["end_error_m"] for row in rows}
    assert list(ends) == ["dead_reckoning", "mine-scale1.0", "mine-scale0.5", "c"]
    assert ends["c"] == pytest.approx(ends["mine-scale1.0"], rel=1e-9)
    assert ends["mine-scale0.5"] > ends["mine-scale1.0"]
    assert all(json.loads(row["spec"])["code"] for row in rows[1:])


def script(tmp_path: Path, body: str) -> list[str]:
    """Write a program that gets the folder and the file as a and b."""
    path = tmp_path / "program.py"
    head = "import sys, time\nfrom pathlib import Path\na, b = map(Path, sys.argv[1:3])\n"
    path.write_text(head + body)
    return [sys.executable, "-I", str(path), *GIVEN]


READS = "read = [p.read_bytes() for p in a.rglob('*') if p.is_file()]\n"
WRONG = {
    "crash": READS + "sys.exit('no good')",
    "timeout": READS + "time.sleep(60)",
    "not_finite": READS + f"b.write_text({GOOD.replace('0.1', 'nan')!r})",
    "malformed_output": READS + "b.write_text('1000000.0 1 2 3\\n')",
    "malformed_output in nanoseconds": READS + "b.write_text('1000000000000000 0 0 0 0 0 0 1\\n')",
    "malformed_output at other times": READS + "b.write_text('2000000.0 0 0 0 0 0 0 1\\n')",
    "unordered_times": READS + f"b.write_text({GOOD!r} + {GOOD!r})",
    "memory_limit": READS + "held = []\nwhile True: held.append(b'1' * 10_000_000)",
    "output_limit": READS + "b.write_bytes(b'0' * 50_000_000)",
    "unread_measurements": f"b.write_text({GOOD!r})",
    "no_output": READS,
    "wrong_frame": READS + "b.write_text('1000000.0 0 0 0 0 0.7071068 0 0.7071068\\n')",
    "wrong_length": READS + f"b.write_text({GOOD!r})\n"
    "b.with_name('covariance.txt').write_text('1 2 3\\n')",
    "bad_covariance": READS + f"b.write_text({GOOD!r})\n"
    "b.with_name('covariance.txt').write_text(2 * ('-1 ' * 36 + '\\n'))",
}


@pytest.mark.parametrize("kind", WRONG)
def test_a_program_that_goes_wrong_has_its_failure(
    recording: Path, tmp_path: Path, kind: str
) -> None:
    """Of its own kind each."""
    limits = LIMITS | {"time_limit_s": 3.0 if kind == "timeout" else 30.0}
    built = build_estimator("program", {"command": script(tmp_path, WRONG[kind]), **limits})
    with pytest.raises(EstimatorFaultError) as raised:
        built.estimate(read_measurements(recording))
    assert raised.value.kind == kind.split()[0], raised.value


def test_words_in_a_comment_are_no_numbers(recording: Path, tmp_path: Path) -> None:
    """Nanoseconds and information are not NaN and infinity."""
    body = READS + f"b.write_text('# information, nanoseconds\\n' + {GOOD!r})"
    built = build_estimator("program", {"command": script(tmp_path, body), **LIMITS})
    assert len(built.estimate(read_measurements(recording)).trajectory) == 2


@pytest.mark.parametrize("needs", [[], ["images"]])
def test_images_are_written_for_a_program_that_needs_them(needs: list[str], tmp_path: Path) -> None:
    """They are in the folder, or nothing of them is."""
    body = READS + "sys.exit(str(any(a.rglob('*.png'))))"
    spec = {"command": script(tmp_path, body), "needs": needs, **LIMITS}
    with pytest.raises(EstimatorFaultError, match=str(bool(needs))):
        build_estimator("program", spec).estimate(small().measurements)


def test_a_program_finds_no_truth(recording: Path, tmp_path: Path) -> None:
    """Not by the very path of the recording, nor by the processes about it."""
    places = [str(recording), "/proc/{}/cwd/tiny.rrd", str(recording.parent)]
    body = READS + (
        "import os\nseen = []\n"
        f"for place in {places!r}:\n"
        "    try:\n"
        "        place = place.format(os.getppid())\n"
        "        seen.append(os.listdir(place) if os.path.isdir(place) else open(place, 'rb'))\n"
        "    except OSError:\n"
        "        pass\n"
        f"b.write_text({GOOD!r}) if not seen else sys.exit(str(seen))"
    )
    built = build_estimator("program", {"command": script(tmp_path, body), **LIMITS})
    assert len(built.estimate(read_measurements(recording)).trajectory) == 2


def test_a_program_that_is_not_there_is_told_in_a_sentence() -> None:
    """Before anything is run; its spec alone is no error."""
    assert ProgramSpec(command=("./nowhere",)).code == ""
    with pytest.raises(SpecError, match=r"there is no program './nowhere': give one on the PATH"):
        build_estimator("program", {"command": ["./nowhere"]})
    with pytest.raises(SpecError, match="as a list"):
        build_estimator("program", {"command": "./nowhere {measurements}"})
    with pytest.raises(SpecError, match=r"there is no {estimat}; there are {measurements}"):
        build_estimator("program", {"command": ["./nowhere", "{estimat}"]})
