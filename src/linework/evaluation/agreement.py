"""Two line sets can be compared only where they stand in the same coordinate reference system."""

from __future__ import annotations

import warnings

from linework.errors import CrsError
from linework.files.crs import LOCAL, describe_crs, has_height, same_crs, same_plan


def check_crs(extracted: str, reference: str) -> None:
    """Raise unless both are in one CRS.

    Parameters
    ----------
    extracted, reference
        WKT2, or "local". A CRS without a height datum agrees with one that has it (some formats drop it):
        heights are then compared as they are, with a warning.

    Raises
    ------
    CrsError
        They differ, or only one of them is "local".
    """
    if same_crs(extracted, reference):
        return
    a, b = describe_crs(extracted), describe_crs(reference)
    if LOCAL in (extracted, reference):
        raise CrsError(
            f"lines are in {a}, reference in {b} (local: metres, no place on earth)",
            where="evaluate",
            advice="give --crs to say what the file in no CRS is in",
        )
    if not same_plan(extracted, reference) or (has_height(extracted) and has_height(reference)):
        raise CrsError(
            f"lines are in {a}, reference in {b}",
            where="evaluate",
            advice="transform one of them",
        )
    stated = a if has_height(extracted) else b
    warnings.warn(
        f"only one side says what its heights refer to ({stated}): they are compared as they are",
        stacklevel=3,
    )
