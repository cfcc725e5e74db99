"""The road as a surface: axis, crossfall, and on either side kerb or pavement edge and the land beyond."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.simulation.roads.alignment import Alignment, Mouth, PiecewiseLinear, widening
from linework.simulation.scene.materials import Material

#: A kerb's face leans this far back from foot to top (an upright kerb, DIN 483: 10 mm or more).
KERB_BATTER_M = 0.02


@dataclass(frozen=True, slots=True)
class SideSection:
    """One side of the road, from the axis outward.

    Parameters
    ----------
    width_m
        Distance from the axis to the edge of the carriageway surface.
    form
        "kerb", "edge" or "barrier": what bounds the carriageway.
    step_m
        Signed height of the step at that edge as a function of chainage: that of the kerb, or of the verge.
    land_d_m, land_z_m
        The land beyond: distances from the carriageway's edge (ascending from 0) and heights over the top of
        the full step.
    land_material
        Material of each interval of `land_d_m`; one entry fewer than there.
    mouths
        Mouths of side streets.
    extra_m
        How much further than `width_m` the carriageway reaches, as a function of chainage: a broken edge, a lane
        that begins or ends. At least 0.
    """

    width_m: float
    form: str
    step_m: PiecewiseLinear
    land_d_m: FloatArray
    land_z_m: FloatArray
    land_material: tuple[Material, ...]
    mouths: tuple[Mouth, ...] = ()
    extra_m: PiecewiseLinear = field(default_factory=lambda: PiecewiseLinear.constant(0.0))

    @property
    def reach_m(self) -> float:
        """How far the land, and with it a side street, extends beyond the carriageway [m]."""
        return float(self.land_d_m[-1])

    def rise(self, s: FloatArray, d: FloatArray) -> FloatArray:
        """Return the height over the carriageway's edge at distance `d` beyond it; 0 on the carriageway."""
        step = self.step_m(s)
        full = float(self.step_m.y.max()) if self.form == "kerb" else step
        # Behind a dropped kerb the footway ramps back to its height within a metre
        ramp = (full - step) * np.clip((d - 0.15) / 1.0, 0.0, 1.0)
        land = np.interp(d, self.land_d_m, self.land_z_m)
        return np.where(d <= 0.0, 0.0, step * np.clip(d / KERB_BATTER_M, 0.0, 1.0) + ramp + land)


@dataclass(frozen=True, slots=True)
class Road:
    """Axis and cross-section; offsets are positive to the left of the axis.

    Parameters
    ----------
    alignment
        Axis.
    left, right
        The two sides.
    slope_left, slope_right
        Rise per metre away from the axis as a function of chainage (negative: falls towards the edge).
    stations_m
        Chainages that every mesh along the road uses, so that neighbouring strips meet.
    surface
        What the strip between the sides is made of; only asphalt is a road with boundaries.
    relief
        Waves of open land: amplitude [m], wave numbers along and across [rad/m], phase [rad].
    """

    alignment: Alignment
    left: SideSection
    right: SideSection
    slope_left: PiecewiseLinear
    slope_right: PiecewiseLinear
    stations_m: FloatArray
    surface: Material = Material.ASPHALT
    relief: tuple[tuple[float, float, float, float], ...] = ()

    def side(self, sign: int) -> SideSection:
        """Return the left (+1) or right (-1) side."""
        return self.left if sign > 0 else self.right

    def carriageway_height(self, s: AnyArray | float, q: AnyArray | float) -> FloatArray:
        """Return the height of the carriageway, continued level beyond its edges; local frame."""
        left = np.clip(q, 0.0, self.left.width_m)
        right = np.clip(-np.asarray(q), 0.0, self.right.width_m)
        tilt = self.slope_left(s) * left + self.slope_right(s) * right
        height = np.asarray(self.alignment.height(s) + tilt, dtype=np.float64)
        for amplitude, along, across, phase in self.relief:
            height = height + amplitude * np.sin(along * np.asarray(s) + across * np.asarray(q) + phase)
        return height

    def ground_height(self, s: AnyArray | float, q: AnyArray | float) -> FloatArray:
        """Return the height of the ground anywhere: carriageway, kerb, footway, verge, land; local frame."""
        s, q = np.broadcast_arrays(np.asarray(s, dtype=np.float64), np.asarray(q, dtype=np.float64))
        return np.asarray(
            self.carriageway_height(s, q)
            + np.where(q >= 0.0, _beyond(self.left, s, q), _beyond(self.right, s, -q))
        )

    def place(self, s: AnyArray | float, q: AnyArray | float, z: AnyArray | float) -> FloatArray:
        """Return (..., 3) local positions at chainage `s`, offset `q` and local height `z`."""
        s, q, z = np.broadcast_arrays(
            np.asarray(s, dtype=np.float64), np.asarray(q, dtype=np.float64), np.asarray(z, dtype=np.float64)
        )
        xy, heading = self.alignment.position(s), self.alignment.heading(s)
        return np.stack([xy[..., 0] - q * np.sin(heading), xy[..., 1] + q * np.cos(heading), z], axis=-1)

    def on_ground(
        self, s: AnyArray | float, q: AnyArray | float, above_m: AnyArray | float = 0.0
    ) -> FloatArray:
        """Return (..., 3) local positions `above_m` over the ground."""
        return self.place(s, q, self.ground_height(s, q) + above_m)

    def over_carriageway(
        self, s: AnyArray | float, q: AnyArray | float, above_m: AnyArray | float
    ) -> FloatArray:
        """Return (..., 3) local positions `above_m` over the carriageway, continued level beyond its edges."""
        return self.place(s, q, self.carriageway_height(s, q) + above_m)

    def stations_between(self, start_m: float, end_m: float) -> FloatArray:
        """Return the stations from `start_m` to `end_m`, both included."""
        inside = self.stations_m[(self.stations_m > start_m + 1e-6) & (self.stations_m < end_m - 1e-6)]
        return np.concatenate([[start_m], inside, [end_m]])

    def truth_chainages(self, start_m: float, end_m: float) -> FloatArray:
        """Return the chainages of truth vertices: every 0.5 m, in bends under 80 m radius every 0.25 m.

        A chord of 0.25 m departs from an arc of 18 m radius by 0.4 mm.
        """
        tight = np.any(np.abs(self.alignment.curvature(np.arange(start_m, end_m, 0.5))) > 1.0 / 80.0)
        n = int(np.ceil((end_m - start_m) / (0.25 if tight else 0.5) - 1e-9)) + 1
        return np.linspace(start_m, end_m, max(n, 2))

    def furthest_offset(self, s: FloatArray, sign: int, reach_m: float) -> FloatArray:
        """Return the largest unsigned offset of a strip that does not fold over at the centre of the bend."""
        turn = np.maximum(self.alignment.curvature(s) * sign, 1e-9)
        return np.asarray(np.minimum(reach_m, 0.85 / turn))


def _beyond(side: SideSection, s: FloatArray, q: FloatArray) -> FloatArray:
    """Return the height over the carriageway's edge at unsigned offsets `q`; 0 on the carriageway."""
    wide = np.maximum(widening(side.mouths, s, side.reach_m), side.extra_m(s))
    return side.rise(s, q - side.width_m - wide)


def make_stations(
    alignment: Alignment, breaks_m: FloatArray, *, half_width_m: float, tolerance_m: float = 0.0003
) -> FloatArray:
    """Return chainages dense enough that chords depart from the curved surface by less than `tolerance_m`.

    `breaks_m` (ends of dropped kerbs and the like) are all stations. Steps are at most 1 m: over
    that length, the crossfall of a superelevation ramp twists a 1 m cell by less than a millimetre.
    """
    fine = np.arange(alignment.start_m, alignment.end_m, 0.05)
    bend = np.abs(alignment.curvature(fine))
    # The outer edge is longer than the axis by (1 + k w); its sagitta is k (1 + k w) ds^2 / 8
    sag = np.maximum(bend * (1.0 + bend * half_width_m), 1e-9)
    step = np.minimum(np.sqrt(8.0 * tolerance_m / sag), 1.0)
    count = np.concatenate([[0.0], np.cumsum(0.05 / step)])
    grid = np.interp(np.arange(0.0, count[-1]), count, np.append(fine, alignment.end_m))
    inside = breaks_m[(breaks_m > alignment.start_m) & (breaks_m < alignment.end_m)]
    return np.unique(np.round(np.concatenate([grid, inside, [alignment.start_m, alignment.end_m]]), 4))
