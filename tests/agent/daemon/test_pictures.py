"""A PNG of ours is read back by a library that is not ours, pixel for pixel."""

import io

import numpy as np
from PIL import Image

from agent.daemon.pictures import FAR, png_of_depth, png_of_rgb


def test_a_colour_picture_reads_back() -> None:
    picture = np.random.default_rng(0).integers(0, 256, (103, 101, 3)).astype(np.uint8)
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(png_of_rgb(picture)))), picture)


def test_depth_reads_back_in_millimetres_and_nothing_is_far() -> None:
    depth = np.array([[0.0, 0.5], [1.2344, 65.0], [100.0, np.inf], [np.nan, -1.0]], np.float32)
    read = np.asarray(Image.open(io.BytesIO(png_of_depth(depth))), np.int64)
    assert read.tolist() == [[0, 500], [1234, 65_000], [FAR, FAR], [FAR, 0]]
