"""BoxSet: many oriented bounding boxes found in the points, as columns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import needed
from linework.model.columns import Columns, column, column_types, filled_column


class BoxForm(IntEnum):
    """Feature that a box is a piece of."""

    #: A stripe of paint, narrow enough for a line.
    STRIPE = 0
    #: Other paint: bars, arrows, letters.
    OTHER_PAINT = 1
    #: The foot of a kerb.
    KERB = 2
    #: The edge of the pavement, without a kerb.
    EDGE = 3
    #: The foot of a barrier or a wall that stands on the carriageway's edge.
    BARRIER = 4
    #: A change of the ground: of its brightness, its roughness or its height, too little for any of the others.
    CHANGE = 5
    #: A line to which the ground falls from both sides, as carriageway and footway do where they meet flush.
    CHANNEL = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class BoxSet(Columns):
    """n oriented boxes, in plan: centre, u-axis along the feature, v-axis to its left.

    Parameters
    ----------
    centre
        (n, 3) float64 [m, from the survey's local origin]: on the feature's reference line.
    u
        (n, 2) float64: unit vector along the feature. Boundaries: the carriageway is on its LEFT (+v side).
        Stripes: either way round.
    half_u_m
        (n,) float64 [m]: half the length along u that has evidence; the centre is its middle.
    half_v_m
        (n,) float64 [m]: half the width; for a stripe, half the width of the paint.
    sigma_v_m, sigma_z_m, sigma_u_rad
        (n,) float64: standard deviation of the centre across, of its height, and of the direction.
    score
        (n,) float64, 0 to 1: how certain it is that this is a piece of such a feature.
    form
        (n,) int8: see `BoxForm`.
    height_m
        (n,) float64 [m]: step from the foot up to the top (boundaries); by how much the ground on the left of paint
        lies higher than that on its right.
    top_v_m
        (n,) float64 [m]: position of the kerb's top edge along v from the centre (negative: away from the
        carriageway); NaN where there is none.
    contrast
        (n,) float64: mean intensity of the paint over that of the surface beside it; of a change of the ground by
        brightness alone, that of its outer side over that of its inner one; NaN for other boundaries.
    rougher
        (n,) float64 [ratio]: noise of the ground above a kerb's step over that of the floor below it, so the scanner's
        noise and the survey's own roughness cancel; NaN where noise drowns what tells stone from soil, and for other forms.
    uneven_m2, uneven_right_m2
        (n,) float64 [m2]: variance of the ground's own unevenness on the left and on the right of a boundary, over some
        metres and beyond the noise of the points, which may make it negative; NaN where it is not known and for kerbs.
    n_points
        (n,) int64: number of points that the reference line was measured from.
    time_start_s, time_end_s
        (n,) float64 [s]: first and last time of these points; NaN where they have no time.
    """

    centre: FloatArray = column(np.float64, 3)
    u: FloatArray = column(np.float64, 2)
    half_u_m: FloatArray = filled_column(np.float64, np.nan)
    half_v_m: FloatArray = filled_column(np.float64, np.nan)
    sigma_v_m: FloatArray = filled_column(np.float64, np.nan)
    sigma_z_m: FloatArray = filled_column(np.float64, np.nan)
    sigma_u_rad: FloatArray = filled_column(np.float64, np.nan)
    score: FloatArray = filled_column(np.float64, 1.0)
    form: AnyArray = filled_column(np.int8, 0)
    height_m: FloatArray = filled_column(np.float64, np.nan)
    top_v_m: FloatArray = filled_column(np.float64, np.nan)
    contrast: FloatArray = filled_column(np.float64, np.nan)
    rougher: FloatArray = filled_column(np.float64, np.nan)
    uneven_m2: FloatArray = filled_column(np.float64, np.nan)
    uneven_right_m2: FloatArray = filled_column(np.float64, np.nan)
    n_points: AnyArray = filled_column(np.int64, 0)
    time_start_s: FloatArray = filled_column(np.float64, np.nan)
    time_end_s: FloatArray = filled_column(np.float64, np.nan)

    def time_span(self, index: AnyArray) -> tuple[float, float]:
        """Return the first and the last time of some boxes [s]; NaN where none has times."""
        start, end = self.time_start_s[index], self.time_end_s[index]
        known = np.isfinite(start) & np.isfinite(end)
        return (float(start[known].min()), float(end[known].max())) if known.any() else (np.nan, np.nan)

    def along(self, index: AnyArray) -> FloatArray:
        """Return (k,) distances [m] along the centres of some boxes, in plan, from the first."""
        step = np.linalg.norm(np.diff(self.centre[index, :2], axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(step)])

    def plot(self, ax: Any = None, **options: Any) -> Any:
        """Draw the boxes in plan, coloured by form, and return the axes.

        Parameters
        ----------
        ax
            Axes of matplotlib; None: of a new figure.
        **options
            For `matplotlib.collections.PolyCollection`.
        """
        pyplot = needed("matplotlib.pyplot", _EXTRA, where="plot()")
        collections = needed("matplotlib.collections", _EXTRA, where="plot()")
        ax = pyplot.subplots()[1] if ax is None else ax
        along = self.u * self.half_u_m[:, None]
        left = np.stack([-self.u[:, 1], self.u[:, 0]], axis=-1) * np.nan_to_num(self.half_v_m)[:, None]
        xy = self.centre[:, :2]
        corners = np.stack(
            [xy - along - left, xy + along - left, xy + along + left, xy - along + left], axis=1
        )
        for form, colour in _COLOURS.items():
            own = corners[self.form == form]
            if len(own):
                name = form.name.lower().replace("_", " ")
                look = {"facecolors": "none", "edgecolors": colour, "linewidths": 0.8, "label": name}
                ax.add_collection(collections.PolyCollection(own, **(look | options)))
        if ax.get_legend_handles_labels()[0]:
            ax.legend()
        ax.autoscale_view()
        ax.set_aspect("equal")
        ax.set_xlabel("east [m]")
        ax.set_ylabel("north [m]")
        ax.ticklabel_format(useOffset=False, style="plain")
        return ax


#: Extra that installs matplotlib.
_EXTRA = "reports"
#: Colours of boxes by form, as in the pictures of the guides.
_COLOURS = {
    BoxForm.STRIPE: "#1f6fd1",
    BoxForm.OTHER_PAINT: "#2e9e4f",
    BoxForm.KERB: "#d62728",
    BoxForm.EDGE: "#ff8c1a",
    BoxForm.BARRIER: "#8c4bbf",
    BoxForm.CHANGE: "#a68a64",
    BoxForm.CHANNEL: "#6a8caf",
}

#: Columns beside `centre` and `u`, in order.
BOX_COLUMNS = tuple(name for name in column_types(BoxSet) if name not in ("centre", "u"))
