"""Sets of lines of every sort, for hypothesis."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from linework.model.columns import column_types
from linework.model.lines import KINDS, LINE_COLUMNS, VERTEX_COLUMNS, LineSet

CRS = ("local", "EPSG:25832", "EPSG:25832+7837", "EPSG:2263+6360")
TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=6)
NUMBERS = st.floats(-1e6, 1e6) | st.just(np.nan)


@st.composite
def line_sets(draw, *, most: int = 5, fewest_vertices: int = 2) -> LineSet:
    """Return up to `most` lines with odd values in every column."""
    counts = draw(st.lists(st.integers(fewest_vertices, 6), max_size=most))
    n, m = sum(counts), len(counts)
    xyz = draw(npst.arrays(np.float64, (n, 3), elements=st.floats(-1e7, 1e7)))
    columns = {}
    for name, (dtype, _, _) in column_types(LineSet).items():
        size = n if name in VERTEX_COLUMNS else m
        values = {np.float64: NUMBERS, np.bool_: st.booleans(), np.str_: TEXTS}[dtype]
        if name == "kind":
            values = st.sampled_from(KINDS) | TEXTS
        # Few different values: what matters is that they come back at their own places
        few = draw(st.lists(values, min_size=1, max_size=2))
        columns[name] = np.array([few[i % len(few)] for i in range(size)], dtype=dtype)
    assert set(columns) == {*LINE_COLUMNS, *VERTEX_COLUMNS}
    pieces = np.split(xyz, np.cumsum(counts)[:-1]) if m else []
    return LineSet.from_lines(pieces, crs=draw(st.sampled_from(CRS)), **columns)
