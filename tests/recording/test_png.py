"""Images go through PNG without loss, and other programs can read them."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from lpet_sim.errors import RecordingError
from lpet_sim.recording.png import decode_png, encode_png


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (5, 1), (48, 64), (31, 17)])
@pytest.mark.parametrize("top", [1, 256, 4095, 4096, 65536])
def test_pixels_come_back_to_the_bit(kind: type, shape: tuple[int, int], top: int) -> None:
    """Of any size and depth, whichever bits are used."""
    high = min(top, np.iinfo(kind).max + 1)
    image = np.random.default_rng(top).integers(0, high, shape).astype(kind)
    image[0, 0] = high - 1
    back = decode_png(encode_png(image))
    assert back.dtype == image.dtype and np.array_equal(back, image)


@pytest.mark.parametrize(
    ("kind", "top", "shift"), [(np.uint8, 256, 0), (np.uint16, 65536, 0), (np.uint16, 4096, 4)]
)
def test_another_program_reads_the_same_pixels(kind: type, top: int, shift: int) -> None:
    """The files are PNG; 12-bit values fill the upper bits of 16, as viewers expect."""
    image = np.random.default_rng(1).integers(0, top, (20, 30)).astype(kind)
    image[0, 0] = top - 1
    with Image.open(io.BytesIO(encode_png(image))) as other:
        assert np.array_equal(np.asarray(other), image << shift)


def test_a_part_of_an_array_is_encoded_as_it_is_seen() -> None:
    """Strides do not matter."""
    whole = np.arange(600, dtype=np.uint16).reshape(20, 30)
    for view in (whole[::2, ::3], whole.T, whole[:, 5:9]):
        assert np.array_equal(decode_png(encode_png(view)), view)


@pytest.mark.parametrize("data", [b"", b"\x89PNG\r\n\x1a\n", b"x" * 100])
def test_what_is_not_such_a_png_is_refused(data: bytes) -> None:
    """With a sentence, not a traceback from the depths."""
    with pytest.raises(RecordingError, match="cannot be decoded"):
        decode_png(data)


def test_a_cut_png_is_refused() -> None:
    """Half an image is no image."""
    data = encode_png(np.random.default_rng(0).integers(0, 255, (40, 40)).astype(np.uint8))
    with pytest.raises(RecordingError, match="cannot be decoded"):
        decode_png(data[: len(data) // 2])
