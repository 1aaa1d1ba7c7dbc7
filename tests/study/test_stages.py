"""The chain makes what is missing or out of date, and nothing else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lpet_sim.errors import OutputError
from lpet_sim.study.stages import Products, Stage, digest, run_stages

Make = Callable[[Products, Path], None]


def writes(text: str) -> Make:
    """Make a stage's work: its text after those of the products that it needs."""

    def make(products: Products, path: Path) -> None:
        path.write_text("+".join([*(p.read_text() for p in products.values()), text]))

    return make


def chain(first: str = "a", second: str = "b", third: str = "c") -> list[Stage]:
    """Make three stages: the second hangs on the first, the third on neither."""
    return [
        Stage("first", "first.txt", (), first, writes(first)),
        Stage("second", "second.txt", ("first",), second, writes(second)),
        Stage("third", "third.txt", (), third, writes(third)),
    ]


def states(folder: Path, stages: list[Stage]) -> dict[str, str]:
    """Run and say what became of each stage."""
    return {done.name: done.state for done in run_stages(stages, folder)}


def test_a_chain_is_made_once(tmp_path: Path) -> None:
    """The second call keeps all of it."""
    assert set(states(tmp_path, chain()).values()) == {"made"}
    assert (tmp_path / "second.txt").read_text() == "a+b"
    assert set(states(tmp_path, chain()).values()) == {"kept"}


def test_a_changed_spec_reruns_only_what_depends_on_it(tmp_path: Path) -> None:
    """The first stage's change reaches the second, not the third."""
    run_stages(chain(), tmp_path)
    assert states(tmp_path, chain(first="A")) == {
        "first": "made",
        "second": "made",
        "third": "kept",
    }
    assert (tmp_path / "second.txt").read_text() == "A+b"


def test_a_change_that_leaves_the_product_as_it_was_goes_no_further(tmp_path: Path) -> None:
    """What counts is the product, not how it came about."""
    run_stages(chain(), tmp_path)
    same = chain()
    same[0] = Stage("first", "first.txt", (), "said otherwise", writes("a"))
    assert states(tmp_path, same) == {"first": "made", "second": "kept", "third": "kept"}


def test_a_product_that_the_user_replaced_is_kept_and_used(tmp_path: Path) -> None:
    """Also when the spec would now make another one; without it the stage's own comes back."""
    run_stages(chain(), tmp_path)
    (tmp_path / "first.txt").write_text("mine")
    assert states(tmp_path, chain(first="A"))["first"] == "yours"
    assert (tmp_path / "first.txt").read_text() == "mine"
    assert (tmp_path / "second.txt").read_text() == "mine+b"
    (tmp_path / "first.txt").unlink()
    assert states(tmp_path, chain())["first"] == "made"
    assert (tmp_path / "second.txt").read_text() == "a+b"


def test_a_product_that_was_there_before_the_first_run_is_the_users(tmp_path: Path) -> None:
    """Nothing is written over."""
    (tmp_path / "third.txt").write_text("brought along")
    assert states(tmp_path, chain())["third"] == "yours"
    assert (tmp_path / "third.txt").read_text() == "brought along"


def fills(pieces: int, dies_after: int) -> Make:
    """Make a folder piece by piece, and die on the way."""

    def make(products: Products, path: Path) -> None:
        path.mkdir(exist_ok=True)
        for k in range(pieces):
            if k == dies_after:
                raise KeyboardInterrupt
            if not (path / str(k)).exists():
                (path / str(k)).write_text(f"{dies_after}")

    return make


def folder_stage(pieces: int, dies_after: int, depends_on: str = "") -> list[Stage]:
    """Make a chain of one stage with a folder for its product."""
    return [Stage("pieces", "pieces", (), depends_on, fills(pieces, dies_after))]


def test_a_folder_goes_on_where_a_kill_left_it(tmp_path: Path) -> None:
    """The pieces of the first call stay; a folder of another spec goes."""
    with pytest.raises(KeyboardInterrupt):
        run_stages(folder_stage(4, 2), tmp_path)
    assert states(tmp_path, folder_stage(4, 9)) == {"pieces": "made"}
    texts = [(tmp_path / "pieces" / str(k)).read_text() for k in range(4)]
    assert texts == ["2", "2", "9", "9"]
    assert states(tmp_path, folder_stage(2, 7, "other")) == {"pieces": "made"}
    assert sorted(p.name for p in (tmp_path / "pieces").iterdir()) == ["0", "1"]
    assert (tmp_path / "pieces" / "0").read_text() == "7"


def test_a_stage_without_a_product_is_an_error(tmp_path: Path) -> None:
    """One sentence names the stage."""
    idle = [Stage("idle", "idle.txt", (), "", lambda products, path: None)]
    with pytest.raises(OutputError, match="stage 'idle' left no"):
        run_stages(idle, tmp_path)


def test_the_digest_of_a_folder_names_its_files_and_their_content(tmp_path: Path) -> None:
    """Hidden files, which are under way, do not count."""
    (tmp_path / "a").write_text("1")
    before = digest(tmp_path)
    (tmp_path / ".half").write_text("2")
    assert digest(tmp_path) == before
    (tmp_path / "a").rename(tmp_path / "b")
    assert digest(tmp_path) != before
