"""The image chain: each step against its closed form."""

from __future__ import annotations

import numpy as np
import pytest

from lpet_sim.rng import stream
from lpet_sim.sensors.camera_spec import ImageChainSpec
from lpet_sim.sensors.image_chain import expose, vignetting

FOCAL = 300.0


def chain(**changes: object) -> ImageChainSpec:
    """Make a chain of 12 bit that only quantises, but for the changes."""
    return ImageChainSpec.ideal(12).model_copy(update={"white_radiance": 1.0, **changes})


def flat(level: float) -> np.ndarray:
    """Make an evenly lit image."""
    return np.full((300, 400), level, np.float32)


@pytest.mark.parametrize("level", [0.1, 0.4, 0.8])
def test_photon_noise_has_a_variance_of_the_number_of_electrons(level: float) -> None:
    """var(DN) = electrons (top / full well)^2, plus 1/12 for rounding."""
    spec = chain(photon_noise=True, full_well_e=20_000.0)
    image = expose(flat(level), spec, FOCAL, stream(1, "photons")).astype(float)
    gain = 4095 / 20_000
    assert image.mean() == pytest.approx(level * 4095, rel=1e-3)
    assert image.var() == pytest.approx(level * 20_000 * gain**2 + 1 / 12, rel=0.02)


def test_read_noise_is_there_in_the_dark_half_of_it_clipped() -> None:
    """Over a small pedestal the deviation is the read noise's in DN."""
    spec = chain(read_noise_e=100.0, full_well_e=20_000.0)
    image = expose(flat(0.1), spec, FOCAL, stream(1, "read")).astype(float)
    assert image.std() == pytest.approx(100 * 4095 / 20_000, rel=0.02)


@pytest.mark.parametrize(("bits", "top"), [(8, 255), (12, 4095)])
def test_numbers_are_rounded_to_the_depth_and_clipped(bits: int, top: int) -> None:
    """Radiance 0 to 1.2 gives every number from 0 to the top, none above."""
    ramp = np.linspace(0, 1.2, 30_000, dtype=np.float32).reshape(100, 300)
    spec = chain(bits=bits)
    image = expose(ramp, spec, FOCAL, stream(0, "none"))
    assert image.dtype == (np.uint8 if bits == 8 else np.uint16)
    np.testing.assert_array_equal(np.unique(image), np.arange(top + 1))
    assert np.abs(image - np.minimum(ramp, 1.0) * top).max() <= 0.5 + 1e-3


def test_square_root_encoding_is_the_root_of_the_linear_one() -> None:
    """A quarter of the well is half of the scale."""
    image = expose(flat(0.25), chain(bits=8, encoding="square_root"), FOCAL, stream(0, "none"))
    assert set(np.unique(image)) == {128}


def test_full_vignetting_is_the_fourth_power_of_the_cosine() -> None:
    """At angle a off the axis cos^4 a of the light is left; none is lost on the axis."""
    gain = vignetting(301, 401, FOCAL, 1.0)
    assert gain[150, 200] == 1.0
    assert gain[150, 400] == pytest.approx(np.cos(np.arctan(200 / FOCAL)) ** 4, rel=1e-6)
    assert vignetting(301, 401, FOCAL, 0.5)[0, 0] == pytest.approx((1 + gain[0, 0]) / 2, rel=1e-6)


def test_blur_spreads_a_point_by_its_sigma_and_keeps_the_light() -> None:
    """The second moment of a blurred point is sigma squared."""
    point = np.zeros((41, 41), np.float32)
    point[20, 20] = 10.0
    image = expose(point, chain(blur_sigma_px=1.5), FOCAL, stream(0, "none")).astype(float)
    v, u = np.mgrid[:41, :41] - 20.0
    assert image.sum() == pytest.approx(10.0 * 4095, rel=3e-3)
    assert (image * u**2).sum() / image.sum() == pytest.approx(1.5**2, rel=0.02)
    assert (image * v**2).sum() / image.sum() == pytest.approx(1.5**2, rel=0.02)


def test_the_same_stream_gives_the_same_image_and_another_does_not() -> None:
    """Noise comes from the generator alone."""
    spec = ImageChainSpec()
    first = expose(flat(0.2), spec, FOCAL, stream(3, "left", 0))
    again = expose(flat(0.2), spec, FOCAL, stream(3, "left", 0))
    other = expose(flat(0.2), spec, FOCAL, stream(3, "right", 0))
    np.testing.assert_array_equal(first, again)
    assert np.mean(first != other) > 0.2
