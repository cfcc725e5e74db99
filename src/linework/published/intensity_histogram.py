"""Histogram of the intensities in a search area, and the range of paint that it proposes.

In the paper of Kang, Lee and Lee (2023) a person looks at the intensities and sets the range; this is what they look at,
and what parts asphalt from paint where nobody looks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray, IntArray

#: Share of the variance of intensities that lies between paint and asphalt: of a uniform distribution it is 0.75, so
#: below that there are no two classes (N. Otsu, 1979, doi:10.1109/TSMC.1979.4310076).
TWO_CLASSES = 0.75
#: Largest intensity of a laser file (16 bit, LAS 1.4). [1]
LARGEST_INTENSITY = 65535.0


@dataclass(frozen=True, slots=True)
class IntensityHistogram:
    """Histogram of a search area's intensities, and the range of paint that it proposes.

    Parameters
    ----------
    edges, counts
        (b + 1,) and (b,).
    proposed
        Least and largest intensity of paint; None: there are no two classes.
    separation
        Share of the variance that lies between the classes, 0 to 1.
    """

    edges: FloatArray
    counts: IntArray
    proposed: tuple[float, float] | None
    separation: float


def intensity_histogram(intensity: FloatArray, n_bins: int = 64) -> IntensityHistogram:
    """Return the histogram of intensities (n,), and the range above the threshold that parts it best (Otsu).

    >>> found = intensity_histogram(np.array([20.0, 21.0, 22.0, 23.0, 24.0, 80.0, 81.0]))
    >>> [round(v) for v in found.proposed], found.separation > 0.9
    ([52, 65535], True)
    """
    if len(intensity) == 0:
        return IntensityHistogram(np.zeros(n_bins + 1), np.zeros(n_bins, dtype=np.int64), None, 0.0)
    counts, edges = np.histogram(intensity, bins=n_bins)
    middle = 0.5 * (edges[:-1] + edges[1:])
    below = np.cumsum(counts)[:-1].astype(np.float64)
    above = len(intensity) - below
    total = np.cumsum(counts * middle)
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = (total[-1] - total[:-1]) / above - total[:-1] / below
        between = below * above / len(intensity) ** 2 * apart**2
    between = np.nan_to_num(between)
    variance = float(np.average((middle - total[-1] / len(intensity)) ** 2, weights=counts))
    separation = float(between.max() / variance) if variance > 0.0 else 0.0
    # Of thresholds in an empty stretch, which part the classes alike, the middle one
    best = np.flatnonzero(between >= between.max() * (1.0 - 1e-9))
    threshold = float(edges[1 + int(best[len(best) // 2])])
    # Open upwards: other paint of the same line may be brighter
    proposed = (threshold, max(float(edges[-1]), LARGEST_INTENSITY)) if separation > TWO_CLASSES else None
    return IntensityHistogram(edges, counts, proposed, separation)
