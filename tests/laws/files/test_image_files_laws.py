"""Whatever stands in the files around images: a value or one line that names the file, never anything else."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from linework.errors import LineworkError
from linework.files.images.lists import read_image_list, read_times
from linework.files.images.read import image_size, read_image
from linework.files.images.screen import image_thumbnail
from linework.files.logs.keys import read_events
from linework.files.survey.kitti import read_calibration
from linework.model.camera import Camera

CAMERA = Camera(width=8, height=8, fx=5.0, fy=5.0, cx=3.5, cy=3.5)
_words = st.sampled_from(
    ["time_s", "file", "key", "note", ",", ";", '"', "1", "2.5", "-1e300", "nan", "inf", "a.png", "\n", "\r\n", "\r", " ",
     "P0:", "2011-09-26 13:02:25.9", "\ufeff", "é", "../", "\\", "\x1b[31m"]
)  # fmt: skip
_content = st.one_of(
    st.binary(max_size=200),
    st.lists(_words, max_size=60).map(lambda words: "".join(words).encode()),
    st.lists(_words, max_size=40).map(lambda words: ("file,time_s\n" + "".join(words)).encode()),
    st.lists(_words, max_size=40).map(lambda words: ("time_s,key,note\n" + "".join(words)).encode()),
)


def _list(path: Path) -> Any:
    return read_image_list({"images": path.name}, path.parent, "cameras.left")


@pytest.mark.parametrize("read", [_list, read_times, read_events, read_calibration])
@given(content=_content)
def test_any_text_is_a_value_or_one_line(read: Callable[[Path], Any], content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.csv"
        path.write_bytes(content)
        try:
            found = read(path)
        except LineworkError as error:
            assert "\n" not in str(error) and "a.csv" in str(error)
            return
        times = getattr(found, "time_s", None)
        assert times is None or (np.isfinite(times).all() and np.all(np.diff(times) >= 0.0))


_heads = st.sampled_from(
    [b"", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\0\x08\0\0\0\x08\x08\0\0\0\0", b"\xff\xd8\xff\xe0\0\x10JFIF\0",
     b"\xff\xd8\xff\xe1", b"II*\0\x08\0\0\0\x08\0", b"MM\0*", b"BM", b"P5 8 8 255\n", b"P5 8 8 65535\n", b"P6 8 8 255\n"]
)  # fmt: skip


@pytest.mark.parametrize("read", [lambda path: read_image(path, CAMERA), image_size, image_thumbnail])
@given(head=_heads, rest=st.binary(max_size=300))
def test_any_bytes_are_an_image_or_one_line(read: Callable[[Path], Any], head: bytes, rest: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.png"
        path.write_bytes(head + rest)
        try:
            read(path)
        except LineworkError as error:
            assert "\n" not in str(error) and "a.png" in str(error)
