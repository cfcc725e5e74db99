"""Find the images of a camera and their times: a list with times, or a pattern and a file of times."""

from __future__ import annotations

import datetime
import fnmatch
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import ConfigError, InputError
from linework.files.input import matching_paths
from linework.files.logs.clock import in_seconds
from linework.files.logs.tables import finite_number, read_text_table
from linework.files.logs.text import MAX_ROWS, text_lines
from linework.files.outside import check_files_inside
from linework.imaging.pairing import certain_times

#: Suffixes of images that `read_pair` reads.
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".pgm", ".ppm")
#: Share of unusable lines in a list that is tolerated (cut off or garbled here and there).
_MAX_BAD_SHARE = 0.01
#: Date and time as KITTI writes them, to the nanosecond.
_DATE = re.compile(r"(\d{4}-\d\d-\d\d[ T]\d\d:\d\d:\d\d)(\.\d{1,9})?Z?")


@dataclass(frozen=True, slots=True)
class ImageList:
    """The images of a camera in time order.

    Parameters
    ----------
    files
        Paths; not opened, and possibly missing.
    time_s
        (n,) float64 [s], strictly increasing.
    warnings
        One line each: about lines and images left out.
    """

    files: tuple[Path, ...]
    time_s: FloatArray
    warnings: tuple[str, ...] = ()
    left_out: tuple[Path, ...] = ()


def read_image_list(
    settings: Mapping[str, Any], root: Path, name: str, *, only_inside: Path | None = None
) -> ImageList:
    """Find the images of a camera and their times.

    Parameters
    ----------
    settings
        Table [cameras.left] or [cameras.right] of a survey.toml: ``images``, and with a pattern ``times`` (a
        file) or ``rate_hz``; ``time_offset_s`` is added to the times.
    root
        Folder of the survey.toml; names in a list are relative to the folder of the list.
    name
        Name of the table, for messages.
    only_inside
        The survey.toml, where images outside its folder are refused.

    Raises
    ------
    ConfigError
        A pattern without times, or an image outside the folder.
    InputError
        No image, an unreadable list, or different numbers of images and times.
    """
    images = str(settings["images"])
    if images.lower().endswith((".csv", ".txt")):
        files, time_s, warnings = _listed(root / images)
    else:
        files = _matching(root, images, name)
        files, time_s, warnings = _timed(files, settings, root, name)
    if only_inside is not None:
        check_files_inside(files, f"{name}.images", only_inside)
    if len(files) > MAX_ROWS:
        raise InputError(f"{len(files):,} images of {name}, at most {MAX_ROWS:,}", where=root,
                         advice="split the survey")  # fmt: skip
    time_s, odd = in_seconds(time_s, f"{root} ({name})")
    time_s = time_s + float(settings.get("time_offset_s", 0.0))
    ordered, time_s, more, left_out = _in_time_order(files, time_s, name)
    all_warnings = (*warnings, *(f"{name}: {text}" for text in odd), *more)
    return ImageList(ordered, time_s, all_warnings, left_out)


def _listed(path: Path) -> tuple[list[Path], FloatArray, tuple[str, ...]]:
    """Return images and times of a CSV file,time_s."""
    table = read_text_table(path, ("file", "time_s"))
    times = [finite_number(text) for text in table.columns["time_s"]]
    rows = zip(table.columns["file"], times, table.line_numbers, strict=True)
    good = [(file, time, line) for file, time, line in rows if file and time is not None]
    kept = {line for _, _, line in good}
    bad = sorted({*table.bad_lines, *table.line_numbers} - kept)
    if not good:
        raise InputError("lists no image", where=path, advice="each line is file,time_s")
    if len(bad) > 1 + _MAX_BAD_SHARE * (len(bad) + len(good)):
        raise InputError(
            f"line {bad[0]} and {len(bad) - 1} other of {len(bad) + len(good)} lines do not hold a file and a time",
            where=path, advice="each line is file,time_s",
        )  # fmt: skip
    warnings = (f"{path}: {len(bad)} lines left out, the first is line {bad[0]}",) if bad else ()
    # Lists from other systems may use backslashes
    files = [path.parent / file.replace("\\", "/") for file, _, _ in good]
    return files, np.array([time for _, time, _ in good], dtype=np.float64), warnings


def _matching(root: Path, pattern: str, name: str) -> list[Path]:
    """Return the images that match a pattern, ignoring case, in the order of the numbers in their names."""
    place = root / pattern
    base = Path(place.anchor) if place.is_absolute() else Path()
    is_wanted = re.compile(fnmatch.translate(place.name), re.IGNORECASE)
    # Folders may be patterns too, but links are not followed: they may form cycles
    parent = str(place.parent.relative_to(base))
    folders = matching_paths(base, parent) if any(c in parent for c in "*?[") else [base / parent]
    files = [path for folder in folders for path in find_images(folder) if is_wanted.fullmatch(path.name)]
    if not files:
        raise InputError(f"{name}.images: '{pattern}' matches no image", where=root,
                         advice="patterns start from the folder of the survey.toml")  # fmt: skip
    return files


def find_images(folder: Path) -> list[Path]:
    """Return the images of a folder in the order of the numbers in their names.

    Hidden files are ignored: other systems leave such files beside images.

    Raises
    ------
    InputError
        More than a million.
    """
    if not folder.is_dir():
        return []
    names = []
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.lower().endswith(IMAGE_SUFFIXES) and not entry.name.startswith("."):
                names.append(entry.name)
                if len(names) > MAX_ROWS:
                    raise InputError(
                        f"more than {MAX_ROWS:,} images", where=folder, advice="split the survey"
                    )
    return [folder / name for name in sorted(names, key=name_order)]


def name_order(name: str) -> tuple[str, str]:
    """Return a key that puts names with numbers in the order of the numbers.

    >>> sorted(["img10.png", "img9.png"], key=name_order)
    ['img9.png', 'img10.png']
    """
    return re.sub(r"\d+", lambda found: found[0].zfill(18), name.lower()), name


def _timed(
    files: list[Path], settings: Mapping[str, Any], root: Path, name: str
) -> tuple[list[Path], FloatArray, tuple[str, ...]]:
    """Return the images that have a time, and the times."""
    if "times" not in settings:
        if "rate_hz" not in settings:
            raise ConfigError(f"{name}: images is a pattern without times", where=root,
                              advice=f"add {name}.times (a file) or {name}.rate_hz")  # fmt: skip
        numbers = _numbers_of(files)
        places = np.arange(len(files)) if numbers is None else numbers
        return files, places / float(settings["rate_hz"]), ()
    path = root / settings["times"]
    times, by_name = read_times(path)
    if by_name is not None:
        known = dict(zip(by_name, times.tolist(), strict=True))
        found = [file for file in files if file.name in known]
        n_unknown = len(files) - len(found)
        warnings = (f"{path}: {n_unknown} images of {name} have no time",) if n_unknown else ()
        return found, np.array([known[file.name] for file in found], dtype=np.float64), warnings
    if len(times) == len(files):
        return files, times, ()
    # An image or a line is missing: the numbers in the names give the lines
    numbers = _numbers_of(files)
    if numbers is None or numbers[-1] - _first_number(numbers, len(times)) >= len(times):
        raise InputError(f"{len(times)} times for {len(files)} images of {name}", where=path,
                         advice="a line for every image, or a CSV file,time_s")  # fmt: skip
    lines = numbers - _first_number(numbers, len(times))
    return files, times[lines], (f"{path}: {len(times)} times for {len(files)} images of {name}: "
                                 "assigned by the numbers in their names",)  # fmt: skip


def _numbers_of(files: Sequence[Path]) -> np.ndarray[Any, np.dtype[np.int64]] | None:
    """Return the last number in each name, (n,) int64 increasing; None where a name has none."""
    found = [re.findall(r"\d+", file.stem) for file in files]
    if not all(found) or any(len(pieces[-1]) > 12 for pieces in found):
        return None
    numbers = np.array([int(pieces[-1]) for pieces in found], dtype=np.int64)
    return numbers if np.all(np.diff(numbers) > 0) else None


def _first_number(numbers: np.ndarray[Any, np.dtype[np.int64]], n_times: int) -> int:
    """Return the number of the first line's image: 0, or 1 where the numbers run to `n_times`."""
    return 1 if numbers[0] >= 1 and numbers[-1] == n_times else 0


def read_times(path: Path) -> tuple[FloatArray, tuple[str, ...] | None]:
    """Read times: a CSV with ``time_s`` (and ``file``), or one a line: seconds, or dates as KITTI has them.

    Returns
    -------
    time_s, file
        (n,) float64 [s]; dates are seconds since 1970-01-01. Names where the file has them.

    Raises
    ------
    InputError
        A line that is not a time, with its number.
    """
    lines = text_lines(path)
    if not lines:
        raise InputError("holds no times", where=path, advice="one line for every image")
    if "time_s" in lines[0][1].lower():
        table = read_text_table(path, ("time_s",), ("file",))
        names = table.columns.get("file")
        texts = list(zip(table.line_numbers, table.columns["time_s"], strict=True))
        if table.bad_lines:
            texts.insert(0, (table.bad_lines[0], "cut off"))
    else:
        texts, names = lines, None
    times = [_seconds(text.strip()) for _, text in texts]
    if None in times:
        number, _ = texts[times.index(None)]
        raise InputError(f"line {number} is not a time", where=path,
                         advice="seconds, or dates such as 2024-05-28 13:02:25.964")  # fmt: skip
    return np.array(times, dtype=np.float64), names


def _seconds(text: str) -> float | None:
    """Return a time in seconds, or a date in seconds since 1970; None for anything else.

    >>> _seconds("12.5"), _seconds("1970-01-02 00:00:01.25"), _seconds("noon")
    (12.5, 86401.25, None)
    """
    found = _DATE.fullmatch(text)
    if found is None:
        return finite_number(text)
    try:
        moment = datetime.datetime.fromisoformat(found[1]).replace(tzinfo=datetime.UTC)
    except ValueError:
        return None
    return moment.timestamp() + float(found[2] or 0.0)


def _in_time_order(
    files: Sequence[Path], time_s: FloatArray, name: str
) -> tuple[tuple[Path, ...], FloatArray, tuple[str, ...], tuple[Path, ...]]:
    """Return the images whose time is certain, in time order, their times, warnings, and the images left out."""
    order = np.arange(len(files))
    if np.any(np.diff(time_s) < 0.0):
        # The order of a list does not matter where names and times have the same order
        by_name = np.array(sorted(order, key=lambda i: name_order(str(files[int(i)]))), dtype=np.int64)
        if np.all(np.diff(time_s[by_name]) >= 0.0):
            order = by_name
    files, time_s = [files[int(i)] for i in order], time_s[order]
    certain = certain_times(time_s)
    steps = np.diff(time_s)
    warnings = []
    if np.any(steps < 0.0):
        i = int(np.argmax(steps < 0.0))
        n_left_out = int(np.count_nonzero(~certain & (np.diff(time_s, prepend=-np.inf) != 0.0)))
        warnings.append(
            f"{name}: time runs backwards {np.count_nonzero(steps < 0.0)} times, first from {time_s[i]:.3f} to "
            f"{time_s[i + 1]:.3f} s at {files[i + 1].name}: {n_left_out} images whose time occurs twice left out"
        )
    if n_same := int(np.count_nonzero(steps == 0.0)):
        first = files[int(np.argmax(steps == 0.0)) + 1].name
        warnings.append(f"{name}: {n_same} images with a repeated time left out, first {first}")
    left_out = tuple(files[int(i)] for i in np.flatnonzero(~certain))
    kept = np.flatnonzero(certain)
    kept = kept[np.argsort(time_s[kept], kind="stable")]
    return tuple(files[int(i)] for i in kept), time_s[kept], tuple(warnings), left_out
