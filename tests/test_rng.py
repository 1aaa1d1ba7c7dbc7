"""Random streams by name: stable, and independent of each other and of order."""

import numpy as np

from lpet_sim.rng import stream


def test_the_numbers_of_a_stream_never_change() -> None:
    """Golden values: a recording of today must be made again in a year."""
    golden = {
        (0,): 3265775232,
        (7, "traverse", 3, "imu"): 277400227,
        (7, "traverse", 3, "wheels"): 3020961133,
        (-1, "terrain"): 2940060123,
    }
    made = {key: int(stream(*key).integers(2**32)) for key in golden}
    assert made == golden


def test_equal_names_give_equal_numbers_whatever_was_drawn_before() -> None:
    """Another stream made or used in between shifts nothing."""
    first = stream(1, "imu").normal(size=5)
    stream(1, "camera").normal(size=100)
    np.testing.assert_array_equal(first, stream(1, "imu").normal(size=5))


def test_a_stream_depends_on_seed_on_every_name_and_on_their_order() -> None:
    """All of these differ, also where the joined names would read the same."""
    keys = [
        (1, "a", "b"),
        (2, "a", "b"),
        (1, "b", "a"),
        (1, "ab"),
        (1, "a"),
        (1, "a", "b", ""),
        (1,),
    ]
    keys += [(11, "a"), (1, "1", "a")]
    heads = {tuple(stream(*key).integers(2**62, size=2).tolist()) for key in keys}
    assert len(heads) == len(keys)


def test_a_number_and_its_word_are_the_same_name() -> None:
    """``stream(7, "traverse", 3)`` is ``stream(7, "traverse", "3")``, as NumPy integers are too."""
    a, b, c = (stream(7, "traverse", n).integers(2**62) for n in (3, "3", np.int64(3)))
    assert a == b == c


def test_streams_are_not_correlated() -> None:
    """Of 200 streams with neighbouring names no pair correlates beyond chance."""
    draws = np.stack([stream(5, "run", i).normal(size=1000) for i in range(200)])
    correlation = np.corrcoef(draws)[np.triu_indices(200, 1)]
    assert np.abs(correlation).max() < 5.5 / np.sqrt(1000)
    np.testing.assert_allclose(correlation.std() * np.sqrt(1000), 1, atol=0.03)


def test_the_first_numbers_of_many_streams_are_uniform() -> None:
    """The keys mix well: mean and variance of the first draw over 2000 seeds."""
    first = np.array([stream(seed, "x").random() for seed in range(2000)])
    assert abs(first.mean() - 0.5) < 4 / np.sqrt(12 * 2000)
    np.testing.assert_allclose(first.var(), 1 / 12, rtol=0.08)


def test_the_global_generator_is_left_alone() -> None:
    """Making and using a stream draws nothing from NumPy's own state."""
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    stream(1, "x").normal(size=10)
    np.testing.assert_array_equal(before, np.random.get_state()[1])  # noqa: NPY002
