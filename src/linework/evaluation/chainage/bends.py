"""What a value between two lines errs by where it bends from station to station: at dropped kerbs, tapers and bays.

Separate from `samples`, which looks at one station at a time.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable

from linework.evaluation.chainage.samples import Sample
from linework.lines.crosscuts import STATION_M

#: The chord over a bend half-way between two measured places passes it by this share of their second difference. Lines
#: are measured at places up to a station apart.
_SAGITTA = 0.25


def with_bends(samples: Iterable[Sample]) -> list[Sample]:
    """Return samples whose deviations include what lines may miss of bends between stations.

    Lines go straight from one measured place to the next, and each place is a mean over some of the line: where a kerb
    begins to drop, both cut the corner. The bend is seen in the second difference of three neighbouring stations, beyond
    what their deviations make of it; that of the station before or behind counts too, since the bend may lie on either side.
    Where a value goes over from one line to another, as a width at a bay, it steps, and no line cuts a corner: only stations
    between the same two lines are compared.

    Examples
    --------
    >>> upstand = [0.12, 0.12, 0.12, 0.12, 0.04, 0.04]
    >>> kerb = [Sample(float(s), 4.0, "kerb", "upstand", "a", value, 0.002) for s, value in enumerate(upstand)]
    >>> [round(one.sigma, 3) for one in with_bends(kerb)]
    [0.002, 0.002, 0.02, 0.02, 0.02, 0.02]
    """
    found = list(samples)
    lines: dict[tuple[str, str, str, str], dict[int, int]] = defaultdict(dict)
    # Counted from the first: chainages may begin at half a station, and no two may be rounded to one number
    start_m = found[0].station_m if found else 0.0
    for number, one in enumerate(found):
        if one.value is not None and math.isfinite(one.sigma):
            station = round((one.station_m - start_m) / STATION_M)
            lines[one.topic, one.quantity, one.line, one.between][station] = number
    for numbers in lines.values():
        added = {
            k: _unseen_variance(*(found[numbers[i]] for i in (k - 1, k, k + 1)))
            for k in numbers
            if k - 1 in numbers and k + 1 in numbers
        }
        for k, number in numbers.items():
            most = max(added.get(i, 0.0) for i in (k - 1, k, k + 1))
            if most > 0.0:
                found[number] = found[number]._replace(sigma=math.sqrt(found[number].sigma ** 2 + most))
    return found


def _unseen_variance(before: Sample, here: Sample, behind: Sample) -> float:
    """Return the square of the sagitta over a station, less what errors make of it."""
    bend = (before.value or 0.0) + (behind.value or 0.0) - 2.0 * (here.value or 0.0)
    by_errors = before.sigma**2 + 4.0 * here.sigma**2 + behind.sigma**2
    return float(_SAGITTA**2 * max(bend**2 - by_errors, 0.0))
