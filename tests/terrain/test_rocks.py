from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.stats import chi2

from lpet_sim.errors import SpecError
from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rock_sizes import size_law
from lpet_sim.terrain.rock_spec import RockAbundanceSpec, RockSizeClass, RockTableSpec
from lpet_sim.terrain.rocks import COVER_MAX, OCTAVE_COVER_MAX, RockField, Rocks
from lpet_sim.terrain.summary import rock_bins

SQUARE = Box(0.0, 0.0, 100.0, 100.0)
SEEDS = range(20)
TABLE = RockTableSpec(
    rows=(
        RockSizeClass(diameter_min_m=0.1, diameter_max_m=0.3, count_per_m2=0.4, area_fraction=0.01),
        RockSizeClass(
            diameter_min_m=0.3, diameter_max_m=0.8, count_per_m2=0.05, area_fraction=0.008
        ),
        RockSizeClass(
            diameter_min_m=1.0, diameter_max_m=1.5, count_per_m2=0.01, area_fraction=0.012
        ),
    )
)


def flat(xy: Array) -> Array:
    """Level ground."""
    return np.zeros(len(xy))


def wavy(xy: Array) -> Array:
    """Gentle waves."""
    return np.sin(0.3 * xy[:, 0]) + 0.2 * np.cos(0.7 * xy[:, 1])


def diameters_of_terrains(
    spec: RockAbundanceSpec | RockTableSpec, min_diameter_m: float = 0.0
) -> Array:
    """Diameters of the rocks of twenty squares of 100 m, each with a seed of its own."""
    fields = (RockField(spec, seed, flat) for seed in SEEDS)
    return np.concatenate([field.query(SQUARE, min_diameter_m).diameter_m for field in fields])


def chi_square_p(spec: RockAbundanceSpec | RockTableSpec, diameters: Array, edges: Array) -> float:
    """Probability of counts as far from the expected ones as these, if the law holds."""
    bins = rock_bins(size_law(spec), diameters, edges, len(SEEDS) * SQUARE.area_m2)
    statistic = sum((one.count - one.expected) ** 2 / one.expected for one in bins)
    return float(chi2.sf(statistic, len(bins)))


@pytest.mark.parametrize(
    ("k", "smallest_m"), [(0.05, 0.1), (0.07, 0.05), (0.19, 0.1)], ids=["5%", "7%", "19%"]
)
def test_counts_follow_golombek_and_rapp_over_twenty_terrains(k: float, smallest_m: float) -> None:
    """Chi-square over bins of size, 20 terrains of 100 x 100 m; and it sees a k off by 2 %."""
    spec = RockAbundanceSpec(k=k)
    edges = np.array([smallest_m, 0.07, 0.1, 0.14, 0.2, 0.3, 0.5, 0.8, 1.2, 2.5])
    edges = edges[edges >= smallest_m]
    diameters = diameters_of_terrains(spec, smallest_m)
    assert diameters.min() >= smallest_m and diameters.max() <= 2.5
    assert chi_square_p(spec, diameters, edges) > 0.01
    assert chi_square_p(RockAbundanceSpec(k=1.02 * k), diameters, edges) < 0.01


def test_a_table_gives_its_counts_and_areas_over_twenty_terrains() -> None:
    """Counts of each class by chi-square; covered areas within four standard errors."""
    diameters = diameters_of_terrains(TABLE)
    area_m2 = len(SEEDS) * SQUARE.area_m2
    edges = np.array([0.1, 0.2, 0.3, 0.55, 0.8, 1.25, 1.5])
    assert chi_square_p(TABLE, diameters, edges) > 0.01
    for row in TABLE.rows:
        low, high = row.diameter_min_m, row.diameter_max_m
        discs = math.pi / 4 * diameters[(diameters >= low) & (diameters <= high)] ** 2
        error = math.sqrt(float(np.sum(discs**2))) / area_m2
        assert row.area_fraction is not None
        assert abs(discs.sum() / area_m2 - row.area_fraction) < 4.0 * error
        assert error < 0.03 * row.area_fraction


def test_the_count_in_a_square_is_a_poisson_number() -> None:
    """Over 64 squares of 16 m the variance is the mean, within its 99.9 % band."""
    rocks = RockField(RockAbundanceSpec(k=0.05), 11, flat).query(Box(0, 0, 128, 128), 0.2)
    cell = (rocks.p_world_rock[:, :2] // 16.0).astype(int)
    counts = np.bincount(cell[:, 0] * 8 + cell[:, 1], minlength=64)
    dispersion = float(np.sum((counts - counts.mean()) ** 2) / counts.mean())
    assert chi2.ppf(0.0005, 63) < dispersion < chi2.ppf(0.9995, 63)


def test_the_number_multiplier_multiplies_the_rocks() -> None:
    """K = 2 gives twice the rocks, within four standard deviations, for either kind of spec."""
    for spec in (RockAbundanceSpec(k=0.05), TABLE):
        double = spec.model_copy(update={"number_multiplier": 2.0})
        found = len(RockField(double, 5, flat).query(SQUARE, 0.1))
        expected = 2.0 * size_law(spec).count_above(np.array([0.1]))[0] * SQUARE.area_m2
        assert abs(found - expected) < 4.0 * math.sqrt(expected)


def by_id(rocks: Rocks) -> Rocks:
    """Sort by identity."""
    return rocks.select(np.argsort(rocks.id))


def assert_equal_to_the_bit(a: Rocks, b: Rocks) -> None:
    """Hold every array of two sets of rocks to equal bytes."""
    for name, array in a.arrays().items():
        assert array.tobytes() == b.arrays()[name].tobytes(), name


def test_the_same_rocks_come_whichever_box_asks_and_in_any_order() -> None:
    """Small boxes in a random order, each from the field's own memory, tile the large one."""
    spec = RockAbundanceSpec(k=0.19)
    whole = by_id(RockField(spec, 1, wavy).query(Box(-15, -15, 15, 15)))
    field = RockField(spec, 1, wavy)
    corners = [(x, y) for x in range(-15, 15, 5) for y in range(-15, 15, 5)]
    np.random.default_rng(0).shuffle(corners)
    parts = [field.query(Box(x, y, x + 5, y + 5)) for x, y in corners]
    arrays = {
        name: np.concatenate([part.arrays()[name] for part in parts]) for name in whole.arrays()
    }
    assert_equal_to_the_bit(by_id(Rocks(**arrays)), whole)
    assert len(np.unique(whole.id)) == len(whole)


def test_forgotten_tiles_grow_again_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """With next to no memory the answers are those of unlimited memory."""
    spec, boxes = RockAbundanceSpec(k=0.07), [Box(x, 0, x + 6, 6) for x in (0, 40, 3, 80, 0)]
    kept = RockField(spec, 2, wavy)
    expected = [kept.query(box) for box in boxes]
    monkeypatch.setattr("lpet_sim.terrain.rocks._ROCKS_KEPT", 50)
    forgetful = RockField(spec, 2, wavy)
    for box, rocks in zip(boxes, expected, strict=True):
        assert_equal_to_the_bit(forgetful.query(box), rocks)


def test_memory_stays_flat_over_a_kilometre() -> None:
    """A 20 m window driven along 1 km never keeps more rocks than the limit."""
    field = RockField(RockAbundanceSpec(k=0.07), 0, flat)
    for x in range(0, 1000, 20):
        field.query(Box(x, 0, x + 20, 20), 0.1)
        assert field._rocks_kept <= 100_000 and len(field._tiles) <= 20_000
    assert field._rocks_kept == sum(len(tile.id) for tile in field._tiles.values())


def test_a_smallest_diameter_only_leaves_rocks_out() -> None:
    """Asking for large rocks gives those of the full answer, with the same ids."""
    spec = RockAbundanceSpec(k=0.19)
    box = Box(3.0, -2.0, 20.0, 11.0)
    full = RockField(spec, 4, wavy).query(box)
    large = RockField(spec, 4, wavy).query(box, 0.22)
    assert_equal_to_the_bit(full.select(full.diameter_m >= 0.22), large)


def deepest_overlap_m(rocks: Rocks) -> float:
    """Largest overlap of two rocks' reaches, negative where all are apart."""
    tree = cKDTree(rocks.p_world_rock[:, :2])
    pairs = tree.query_pairs(2.0 * float(rocks.reach_m.max()), output_type="ndarray")
    a, b = pairs.T
    gaps = np.linalg.norm(rocks.p_world_rock[a, :2] - rocks.p_world_rock[b, :2], axis=1)
    return float(np.max(rocks.reach_m[a] + rocks.reach_m[b] - gaps))


@pytest.mark.parametrize("seed", [0, 1])
def test_no_two_rocks_overlap_even_across_the_borders_of_tiles(seed: int) -> None:
    """All corners of all rocks keep to discs that are pairwise apart, over many tiles."""
    rocks = RockField(RockAbundanceSpec(k=0.19), seed, flat).query(Box(-25, -25, 25, 25))
    assert deepest_overlap_m(rocks) <= 1e-9


def one_size(diameter_m: float, cover: float) -> RockSizeClass:
    """Rocks of nearly one size."""
    return RockSizeClass(
        diameter_min_m=0.95 * diameter_m,
        diameter_max_m=1.05 * diameter_m,
        count_per_m2=cover / (math.pi / 4 * diameter_m**2),
        area_fraction=cover,
    )


FULLEST = {
    "one size": RockTableSpec(rows=(one_size(1.0, 0.99 * OCTAVE_COVER_MAX),)),
    "two sizes": RockTableSpec(rows=tuple(one_size(d, 0.495 * COVER_MAX) for d in (1.0, 0.4))),
    "abundance": RockAbundanceSpec(k=0.19, number_multiplier=1.49),
}


@pytest.mark.parametrize("name", FULLEST)
def test_at_the_largest_cover_every_rock_still_finds_a_place(
    name: str, caplog: pytest.LogCaptureFixture
) -> None:
    """None is left out and none overlaps, where the limits are reached to a per cent."""
    field = RockField(FULLEST[name], 0, flat)
    rocks = field.query(Box(0, 0, 60, 60), 0.15)
    law = size_law(FULLEST[name])
    assert law.area_above(np.array([0.01]))[0] > 0.98 * min(COVER_MAX, OCTAVE_COVER_MAX)
    assert not caplog.records
    assert deepest_overlap_m(rocks) <= 1e-9


def test_rocks_do_not_shun_the_borders_of_tiles() -> None:
    """Distances to the nearest border of a 4 m tile are uniform, by chi-square."""
    rocks = RockField(RockAbundanceSpec(k=0.19), 6, flat).query(Box(0, 0, 80, 80), 0.1)
    to_border = np.abs((rocks.p_world_rock[:, 0] + 2.0) % 4.0 - 2.0)
    counts = np.histogram(to_border, bins=np.linspace(0.0, 2.0, 11))[0]
    statistic = float(np.sum((counts - counts.mean()) ** 2) / counts.mean())
    assert chi2.sf(statistic, 9) > 0.001


def test_too_many_rocks_are_refused_with_the_largest_multiplier() -> None:
    """The sentence says what K would have been valid, and that K is."""
    spec = RockAbundanceSpec(k=0.19, number_multiplier=3.0)
    with pytest.raises(SpecError, match=r"number_multiplier must be at most (\d\.\d+)") as caught:
        RockField(spec, 0, flat)
    most = float(str(caught.value).split("at most ")[1].split(" ")[0])
    RockField(spec.model_copy(update={"number_multiplier": 0.999 * most}), 0, flat)


def test_another_seed_gives_other_rocks() -> None:
    """Nothing of one terrain's rocks is found in another's."""
    box, spec = Box(0, 0, 10, 10), RockAbundanceSpec(k=0.07)
    a, b = (RockField(spec, seed, flat).query(box).diameter_m for seed in (0, 1))
    assert len(np.intersect1d(a, b)) == 0


def test_bare_ground_has_no_rocks() -> None:
    """Without a spec every answer is empty and of the right shape."""
    rocks = RockField(None, 0, flat).query(SQUARE)
    assert len(rocks) == 0 and rocks.p_world_rock.shape == (0, 3) and rocks.outlines() == []
