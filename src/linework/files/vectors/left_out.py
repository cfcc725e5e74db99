"""Features of a vector file that cannot be read: named with the vertex and left out, so that the rest stays usable."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray
from linework.errors import InputError


def bad_position(coordinates: Any) -> str:
    """Return what is wrong with the first position that is not numbers in the coordinates of a GeoJSON geometry.

    Returns
    -------
    str
        With the number of the vertex from 1; "" where all positions are numbers.

    Examples
    --------
    >>> bad_position([[0.0, 1.0], [2.0]]), bad_position([[0, 1], [2, None]]), bad_position([[0, 1, 2], [3, 4]])
    ('vertex 2 is not two or three finite numbers', 'vertex 2 is not two or three finite numbers', '')
    """
    waiting, n = [coordinates], 0
    while waiting:
        value = waiting.pop()
        if isinstance(value, list) and any(isinstance(inner, list) for inner in value):
            waiting.extend(reversed(value))
            continue
        n += 1
        is_long = isinstance(value, list) and len(value) >= 2
        if not is_long or not all(_is_number(number) for number in value[:3]):
            return f"vertex {n} is not two or three finite numbers"
    return ""


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def usable_features(
    shapes: AnyArray, chosen: Sequence[int], name_of: Callable[[int], str], left_out: list[str]
) -> list[int]:
    """Return those of the chosen geometries whose places are finite; the others are added to `left_out`.

    Parameters
    ----------
    shapes
        (n,) shapely geometries, or None.
    chosen
        Indices into them.
    name_of
        Returns the name of a feature by its index.
    """
    places, owner = shapely.get_coordinates(shapes[list(chosen)], return_index=True)
    first = np.searchsorted(owner, np.arange(len(chosen)))
    bad = np.flatnonzero(~np.isfinite(places).all(axis=1))
    _, at = np.unique(owner[bad], return_index=True)
    for vertex in bad[at]:
        i = int(owner[vertex])
        left_out.append(f"{name_of(chosen[i])}: vertex {vertex - first[i] + 1} is not finite")
    gone = set(owner[bad].tolist())
    return [index for i, index in enumerate(chosen) if i not in gone]


def left_out_text(left_out: Sequence[str], n_lines: int, path: Path) -> str:
    """Return one line about the features left out, "" for none.

    Raises
    ------
    InputError
        Nothing else is in the file.
    """
    if not left_out:
        return ""
    n = len(left_out)
    others = f" and {n - 1:,} other feature{'s' if n > 2 else ''}" if n > 1 else ""
    problem = f"{left_out[0]}{others}"
    if not n_lines:
        raise InputError(
            f"no line can be read: {problem}", where=path, advice="correct the file, or copy it again"
        )
    return f"{path}: left out {problem}"
