"""Paint along lines that is partly worn off: solid ones in patches, dashed ones on bends, with stains between."""

import numpy as np

from linework.methods.tracking.pattern import merged_intervals


def worn_solid(rng, *, length_m, bare_m=1.25, left=0.5):
    """Return intervals of paint of a solid line: patches of `bare_m` on average are gone, and `left` of all is left."""
    places, start = [], 0.0
    while start < length_m:
        begin = start + rng.exponential(bare_m)
        start = begin + rng.exponential(bare_m * left / (1.0 - left))
        if begin < length_m:
            places.append((begin, min(start, length_m)))
    return merged_intervals(*np.array(places).reshape(-1, 2).T, 0.3)


def worn_dashes(rng, *, length_m, dash_m, gap_m, left=0.6, drift=0.02, blur_m=0.2):
    """Return intervals of paint of a dashed line whose period changes by `drift`: pieces of 0.3 m are left, and stains."""
    start = np.arange(0.0, length_m, dash_m + gap_m)
    start *= 1.0 + drift * np.sin(3.0 * start / length_m)
    places = [
        (a + x - blur_m * rng.random(), a + min(x + 0.3, dash_m) + blur_m * rng.random())
        for a in start
        for x in np.arange(0.0, dash_m, 0.3)
        if rng.random() < left
    ]
    places += [
        (at, at + rng.uniform(0.2, 1.0)) for at in rng.uniform(0.0, length_m, rng.poisson(length_m / 15.0))
    ]
    return merged_intervals(*np.array(sorted(places)).T, 0.3)
