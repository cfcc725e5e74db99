"""Requests to the pictures worker: points of a place or a section, thinned, in the page's binary format."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array
from linework.errors import UsageError
from linework.kernels.cells import even_thinning as kernels
from linework.model.grid import Bounds
from linework.workbench.server.pictures import THICKEST_M, WIDEST_M
from linework.workbench.views.patches import PointPatch
from linework.workbench.views.tiles import patch_reader, picture_scale
from linework.workbench.worker.session import SurveySession

#: Longest side of a place; larger ones are viewed in plan. [m]
LONGEST_PLACE_M = 1000.0
#: Points drawn at random before they are thinned evenly, as a multiple of those wanted.
_BY_LOT = 4
#: Height above the road that stands for "unknown" in the page's format. [cm]
_UNKNOWN_CM = 32767
#: Prime that combines east and north of a patch into one number.
_PRIME = 1_000_003


@dataclass(frozen=True, slots=True)
class SampledPoints:
    """Points of one patch, and random numbers by which they are chosen."""

    xyz: Float32Array
    above: Float32Array
    intensity: AnyArray
    lots: AnyArray

    def by_lot(self, share: float) -> SampledPoints:
        """Return a random share of the points; a smaller share is part of a larger one."""
        if share >= 1.0:
            return self
        kept = self.lots < np.uint64(share * 2.0**64)
        return SampledPoints(self.xyz[kept], self.above[kept], self.intensity[kept], self.lots[kept])


def points_of_place(
    session: SurveySession, bounds: Bounds, most: int, heights: tuple[float, float] = (-math.inf, math.inf)
) -> bytes:
    """Return points of a rectangle, evenly thinned to `most`, in the page's format (see `packed_points`).

    Parameters
    ----------
    heights
        Lowest and highest. [m, world]

    Raises
    ------
    UsageError
        The rectangle is empty, or longer than `LONGEST_PLACE_M`.
    """
    check_place(bounds)
    reader = patch_reader(session)
    origin = math.floor(bounds.west), math.floor(bounds.south), reader.z0_m if reader else 0.0
    if reader is None:
        return packed_points(origin, [], session, most)
    low, high = (height - reader.z0_m for height in heights)
    found: list[SampledPoints] = []
    share = 1.0
    for patch in reader.patches(bounds):
        inside = lies_inside(patch, bounds) & (patch.z >= low) & (patch.z < high)
        found, share = within_share([*found, sample_points(patch, inside, share, origin)], share, most)
    return packed_points(origin, found, session, most)


def lies_inside(patch: PointPatch, bounds: Bounds) -> BoolArray:
    """Return which points (n,) of a patch lie in a rectangle."""
    west, south = bounds.west - patch.corner[0], bounds.south - patch.corner[1]
    inside = (patch.x >= west) & (patch.x < west + bounds.width_m)
    return np.asarray(inside & (patch.y >= south) & (patch.y < south + bounds.height_m))


def within_share(found: list[SampledPoints], share: float, most: int) -> tuple[list[SampledPoints], float]:
    """Return points, and the share of all that they are, halved as often as their number requires: four times `most`.

    The share is the same in whatever order the patches come.
    """
    while sum(len(part.lots) for part in found) > _BY_LOT * most:
        share *= 0.5
        found = [part.by_lot(share) for part in found]
    return found, share


def check_place(bounds: Bounds) -> None:
    """Refuse a rectangle that is empty or too large.

    Raises
    ------
    UsageError
        Names its size.
    """
    if not (bounds.west < bounds.east and bounds.south < bounds.north):
        raise UsageError(
            "the place is empty", advice="its west must be less than its east, its south than its north"
        )
    if max(bounds.width_m, bounds.height_m) > LONGEST_PLACE_M:
        raise UsageError(
            f"a place of {bounds.width_m:,.0f} x {bounds.height_m:,.0f} m, the limit is {LONGEST_PLACE_M:,.0f} m",
            advice="look at a part of it",
        )


def sample_points(
    patch: PointPatch, inside: AnyArray, share: float, origin: tuple[float, float, float]
) -> SampledPoints:
    """Return the points of a patch that are inside (n,), or a random share of them, relative to `origin`."""
    index = np.flatnonzero(inside)
    x, y, z, above, intensity = (column[index] for column in patch.columns)
    salt = (int(patch.corner[0]) * _PRIME + int(patch.corner[1])) & 0x7FFFFFFF
    lots = kernels.sampling_keys(x, y, z, intensity, salt)
    xyz = np.stack(
        [x + np.float32(patch.corner[0] - origin[0]), y + np.float32(patch.corner[1] - origin[1]), z]
    )
    return SampledPoints(np.ascontiguousarray(xyz.T, dtype=np.float32), above, intensity, lots).by_lot(share)


def packed_points(
    origin: tuple[float, float, float], found: list[SampledPoints], session: SurveySession, most: int
) -> bytes:
    """Return points, evenly thinned to `most`, in the page's format (`points` of its api).

    Number of points as uint32, 4 bytes of padding, origin as 3 float64 [m, world], little-endian; then columns: xyz
    float32 from the origin [m], height above the road int16 [cm], brightness uint8 (255: white).
    """
    xyz = np.concatenate([np.zeros((0, 3), np.float32), *(part.xyz for part in found)])
    above = np.concatenate([np.zeros(0, np.float32), *(part.above for part in found)])
    intensity = np.concatenate([np.zeros(0, np.uint16), *(part.intensity for part in found)])
    lots = np.concatenate([np.zeros(0, np.uint64), *(part.lots for part in found)])
    order = np.argsort(lots, kind="stable")
    chosen = order[kernels.evenly_thinned(xyz[order], most)]
    xyz, above, intensity = xyz[chosen], above[chosen], intensity[chosen]
    scale = picture_scale(session)
    shine = np.zeros(len(xyz), np.float32) if scale is None else scale.shine(intensity.astype(np.float32))
    with np.errstate(invalid="ignore"):
        above_cm = np.clip(np.round(100.0 * above), 1 - _UNKNOWN_CM, _UNKNOWN_CM - 1)
    above_cm = np.where(np.isnan(above), _UNKNOWN_CM, np.nan_to_num(above_cm))
    return b"".join(
        (
            struct.pack("<II3d", len(xyz), 0, *origin),
            xyz.astype("<f4").tobytes(),
            above_cm.astype("<i2").tobytes(),
            np.round(255.0 * shine).astype(np.uint8).tobytes(),
        )
    )


#: Most points of a section: a dozen for every pixel.
MOST_SECTION_POINTS = 200_000


def section_at(
    session: SurveySession,
    place: tuple[float, float],
    heading_deg: float,
    half_width_m: float,
    thickness_m: float,
) -> bytes:
    """Return the points of a section across a heading, in the page's format: x to the right of it, y along it.

    Parameters
    ----------
    place
        Its middle (east, north) [m, world], the origin of its points.
    heading_deg
        Clockwise from grid north. [degrees]

    Raises
    ------
    UsageError
        The section is wider than `WIDEST_M` to a side, or thicker than `THICKEST_M`.
    """
    if not 0.0 < half_width_m <= WIDEST_M or not 0.0 < thickness_m <= THICKEST_M:
        raise UsageError(
            f"a section of {half_width_m:g} m to each side and {thickness_m:g} m thick",
            advice=f"up to {WIDEST_M:g} m to each side and {THICKEST_M:g} m thick can be shown",
        )
    reader = patch_reader(session)
    origin = (*place, reader.z0_m if reader else 0.0)
    if reader is None:
        return packed_points(origin, [], session, MOST_SECTION_POINTS)
    sin, cos = math.sin(math.radians(heading_deg)), math.cos(math.radians(heading_deg))
    half_m = 0.5 * thickness_m
    reach = abs(cos) * half_width_m + abs(sin) * half_m, abs(sin) * half_width_m + abs(cos) * half_m
    bounds = Bounds(place[0] - reach[0], place[1] - reach[1], place[0] + reach[0], place[1] + reach[1])
    found = []
    for patch in reader.patches(bounds):
        east = patch.x + np.float32(patch.corner[0] - place[0])
        north = patch.y + np.float32(patch.corner[1] - place[1])
        right, ahead = east * cos - north * sin, east * sin + north * cos
        inside = (np.abs(right) <= half_width_m) & (np.abs(ahead) <= half_m)
        part = sample_points(patch, inside, 1.0, origin)
        xyz = np.stack([right[inside], ahead[inside], part.xyz[:, 2]], axis=1).astype(np.float32)
        found.append(replace(part, xyz=xyz))
    return packed_points(origin, found, session, MOST_SECTION_POINTS)
