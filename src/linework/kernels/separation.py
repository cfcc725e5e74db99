"""Separating axis test of two rectangles in plan."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)
def collides_in_plan(
    ax: float, ay: float, aux: float, auy: float, ahu: float, ahv: float,
    bx: float, by: float, bux: float, buy: float, bhu: float, bhv: float,
) -> bool:  # fmt: skip
    """Return whether two rectangles (centre, u-axis, half extents) share a place: no axis parts them."""
    dx, dy = bx - ax, by - ay
    cos, sin = abs(aux * bux + auy * buy), abs(aux * buy - auy * bux)
    if abs(dx * aux + dy * auy) > ahu + bhu * cos + bhv * sin:
        return False
    if abs(dy * aux - dx * auy) > ahv + bhu * sin + bhv * cos:
        return False
    if abs(dx * bux + dy * buy) > bhu + ahu * cos + ahv * sin:
        return False
    return abs(dy * bux - dx * buy) <= bhv + ahu * sin + ahv * cos
