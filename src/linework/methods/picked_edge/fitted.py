"""Numbers of the picked edge that neither geometry nor a standard fixes, tuned on simulated drives, in one table.

======== =====================================================================================================
how      not recorded
data     simulated drives; the seeds are not recorded
date     2026-11-21
figure   on seeds that took no part (straight 950 to 955; bends, urban, motorway 950 and 951), followed to both
         ends of visibility: 86 % of 108 picks on paint, 31 % of 99 picks on bare edges (40 % of those with 10
         grey levels or more); see docs/methods/stereo-picked.md, "How it is judged"
======== =====================================================================================================

Which of them were tuned one by one, and what each adds, is not recorded.
"""

from __future__ import annotations

from typing import NamedTuple


class MatchLimit(NamedTuple):
    """Smallest correlation of a match, and smallest F ratio of explained to remaining variance."""

    correlation: float
    f_ratio: float


# Edges in a profile

#: Smallest rise of an edge [grey values], and its share in each half of the length: what lies across a line, and grain
#: of the road, is in one half only.
LEAST_RISE, IN_HALVES = 6.0, 0.5
#: Smallest widths of the sides that are compared, for sharp and for soft edges. [m, pixels]
EDGE_SIDES = ((0.04, 2.0), (0.10, 4.0))
#: Both sides of a stripe: least ratio of the lower to the higher, and smallest rise where paint is worn. [1, grey
#: values]
ALIKE_SIDES, LEAST_PAINT = 0.4, 10.0
#: Least contrast between the sides of a stripe as a share of its lower side.
PAINT_BETWEEN = 0.5
#: Least rise of the next edge as a share of an edge's own, for it to count as one beside it.
NEXT_EDGE_SHARE = 0.7

# The picked direction

#: Sine of the largest angle to the path of a line along the road (15 degrees), and the factor on the rise of others:
#: most lines run along the road, while grass and shadows have short edges in all directions.
ALONG_SIN, ACROSS_ROAD = 0.26, 0.5

# Matches

#: Smallest standard deviation of a match: interpolation, and patterns that differ from the template. [pixels]
LEAST_MATCH_SIGMA_PX = 0.1
#: Limits of a match in a narrow gate, which has few places to choose from, and in a wide one.
NARROW_MATCH, WIDE_MATCH = MatchLimit(0.65, 12.0), MatchLimit(0.75, 25.0)
#: Largest factor between the contrasts, over the mean, of match and template. Light and shade change all grey values by
#: one factor; glare and black levels change the contrast. Less contrast is paint that ends within the step or is worn.
MATCH_CONTRAST = 2.5
#: Share of the best correlation from which another match counts as equally good.
AS_GOOD = 0.9
#: Weight of a match in the template: it is renewed over some metres, without the grain of the road.
RENEWED = 0.04
#: Least height of an edge in the template as a share of its earlier one: below, it has vanished.
EDGE_LEFT = 0.3

# Following

#: Steps that must agree, and of how many, before a lost line continues.
AGREE = (3, 4)
#: Factor on the window along the line where one step does not show it.
LONGER = 3.0
#: Window along a bare edge, which is ragged and has no sharp rise. [m]
BARE_EDGE_M = 2.0
#: Most steps in a row measured in one image alone, where the line has left the other one.
ALONE_STEPS = 8
#: Largest half width of a gate: less than the distance to the next line. [m]
MOST_GATE_M = 0.5
#: Fewest vertices measured in both images for a line that is picked, or found again in another pair.
LEAST_CARRIED_PLACES = 4

# Objects in front of a line

#: Smallest correlation of windows that show the same, and by how much the nearer one must exceed that of the road.
SAME_WINDOW, CLEARLY_BETTER = 0.8, 0.1
#: Least disparity of an object on the road, as a multiple of that of the road behind it and in pixels above it.
NEARER_SHARE, NEARER_PX = 1.12, 2.0
