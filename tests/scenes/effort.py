"""How thorough a run of the tests is: quick with `make test`, long with `make truth`."""

from __future__ import annotations

import os

#: Set by `make truth`.
THOROUGH = os.environ.get("LINEWORK_TESTS") == "truth"


def examples(n: int) -> int:
    """Return how many examples hypothesis draws: n in the long run, a quarter of them, at least 5, in the quick one."""
    return n if THOROUGH else max(n // 4, min(n, 5))
