"""Evaluation of extracted lines against reference lines: the measures of road extraction, per kind and overall."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from linework.crs import LOCAL, describe_crs, has_height, same_crs, same_plan
from linework.errors import CrsError, UsageError, argument, did_you_mean
from linework.evaluation.attributes import (
    ATTRIBUTES,
    COMPARED_LABELS,
    attribute_errors,
    group_scores,
    label_scores,
)
from linework.evaluation.calibration import bridged_scores, confidence_calibration, sigma_terciles
from linework.evaluation.chains import COMPARED_PIECE_M, Chains
from linework.evaluation.dashes import DASH_KIND, dash_scores
from linework.evaluation.instances import CHAMFER_M, average_precision
from linework.evaluation.match import TIE_M, PieceMatch, distance_to, match_chains
from linework.evaluation.stations import Stations, measure_stations
from linework.evaluation.tolerance import DASH_END_M, KindMatch, at_tolerance
from linework.evaluation.values import KindScores, Scores
from linework.model.lines import CANDIDATE, KINDS, POLE, LineSet

#: Further tolerances at which scores are computed by default (docs/evaluation.md). [m]
_CURVE_M = (0.05, 0.10, 0.20, 0.50)
#: Largest tolerance [m]: far more than the spacing of neighbouring lines, so that a match is meaningless beyond it.
_MAX_TOLERANCE_M = 10.0
#: Kinds that are found unasked and that few references hold: they are wrong only where the reference has lines of them.
_WHERE_REFERENCE_HAS_THEM = ("edge_other", POLE)


def evaluate(
    found: LineSet,
    truth: LineSet,
    *,
    tolerance_m: float = 0.10,
    kinds: str | Sequence[str] | None = None,
    curve_m: Sequence[float] = _CURVE_M,
) -> Scores:
    """Return the scores of lines that were found against true ones, per kind and overall.

    Parameters
    ----------
    found, truth
        Lines in the same CRS. `observed` marks the parts of the truth that were visible to the sensors.
    tolerance_m
        Distance within which a line counts as found: in space for cables, in plan for all other kinds. [m]
    kinds
        Kind or kinds to score; None: every kind present in either set, `edge_other` and `pole` only where `truth` has
        them, and no candidates. A kind that only one of them has is scored too: nothing of it was found, or nothing of
        it is right (`Scores.missed`, `Scores.unexpected`).
    curve_m
        Further tolerances to score at. [m]

    Raises
    ------
    CrsError
        The two are in different CRSs.
    UsageError
        A tolerance is not positive or is above 10 m, or neither set contains a line; something else than lines; or a
        kind that is unknown and in neither set.
    InputError
        A coordinate is not finite.

    Notes
    -----
    Completeness is computed over the observed part of the truth, and also reported over all of it; correctness and
    redundancy are computed against all of it, since a line that continues correctly where nothing was visible is
    correct. The spacing of vertices and the direction of lines do not matter, except for the sign of the lateral error:
    positive is to the left of the true line's direction.

    References
    ----------
    C. Heipke, H. Mayer, C. Wiedemann, O. Jamet, Evaluation of automatic road extraction, International
    Archives of Photogrammetry and Remote Sensing 32 (3-4W2), 1997. Redundancy and gaps follow the paper; the
    direction test and the observed reference are additions.

    Examples
    --------
    >>> truth = LineSet.from_lines([[[0, 0, 5], [100, 0, 5]], [[0, 9, 5], [50, 9, 5]]], kind=["guardrail", "cable"])
    >>> found = LineSet.from_lines([[[0, 0.03, 5], [100, 0.03, 5]]], kind="guardrail")
    >>> scores = evaluate(found, truth)
    >>> scores
    Scores at 0.1 m: completeness 66.7 %, correctness 100.0 %, lateral rmse 0.030 m
                 completeness  correctness  lateral rmse  height rmse    truth    found
      guardrail       100.0 %      100.0 %       0.030 m      0.000 m  100.0 m  100.0 m
      cable             0.0 %            -             -            -   50.0 m    0.0 m
      nothing found of: cable
    >>> scores["guardrail"].at.completeness, round(scores.overall.at.lateral.bias_m, 3)
    (1.0, 0.03)
    """
    for name, lines in (("found", found), ("truth", truth)):
        if not isinstance(lines, LineSet):
            raise UsageError(f"{type(lines).__name__}, expected a LineSet", where=argument(name),
                             advice="read a file with read_lines")  # fmt: skip
    chosen = None if kinds is None else _kinds_to_score(kinds, found, truth)
    parts = match_lines(found, truth, tolerance_m=tolerance_m, kinds=chosen, curve_m=curve_m)
    if not parts:
        raise UsageError(
            "neither the lines found nor the truth contain a line",
            where="evaluate",
            advice="name the kinds to score",
        )
    return scores_of(parts, tolerance_m=tolerance_m, curve_m=curve_m)


def _kinds_to_score(kinds: str | Sequence[str], *sets: LineSet) -> tuple[str, ...]:
    """Return the kinds that a caller names.

    Raises
    ------
    UsageError
        A kind that linework does not know and that is in neither set.
    """
    chosen = tuple(dict.fromkeys([kinds] if isinstance(kinds, str) else kinds))
    known = tuple(dict.fromkeys((*KINDS, POLE, *kinds_in(*sets))))
    unknown = [str(kind) for kind in chosen if kind not in known]
    if unknown or not chosen:
        problem = "no kind of line is named"
        if unknown:
            problem = f"unknown kinds of line: {', '.join(unknown)}" + did_you_mean(unknown, known)
        raise UsageError(problem, where=argument("kinds"), advice=f"choose from {', '.join(known)}")
    return chosen


def match_lines(
    extracted: LineSet,
    reference: LineSet,
    *,
    tolerance_m: float = 0.10,
    kinds: Sequence[str] | None = None,
    curve_m: Sequence[float] = _CURVE_M,
    dash_end_m: float = DASH_END_M,
) -> tuple[KindMatch, ...]:
    """Return the match of each kind, valid for every tolerance: the first half of `evaluate`.

    Parameters
    ----------
    dash_end_m
        Tolerance for the ends of dashes; the scan-line spacing where that is larger. [m]

    Raises
    ------
    CrsError
        The two are in different CRSs.
    UsageError
        A tolerance is not positive or is above 10 m.
    InputError
        A coordinate is not finite.
    """
    check_crs(extracted.crs, reference.crs)
    for b in (tolerance_m, *curve_m, dash_end_m):
        if not 0 < b <= _MAX_TOLERANCE_M:
            raise UsageError(
                f"tolerance of {b:g} m, expected more than 0 and at most {_MAX_TOLERANCE_M:g} m",
                where="evaluate",
            )
    reach_m = max(tolerance_m, *curve_m)
    chosen = scored_unasked(kinds_in(extracted, reference), reference) if kinds is None else tuple(kinds)
    parts = (match_kind(extracted, reference, kind, reach_m) for kind in chosen)
    return tuple(replace(part, dash_end_m=dash_end_m) for part in parts)


def scored_unasked(kinds: Sequence[str], reference: LineSet) -> tuple[str, ...]:
    """Return those of `kinds` that are scored where none are named.

    Candidates were not taken. `edge_other` and poles count where the reference has lines of them: an empty layer does
    not say that somebody looked for them.

    >>> scored_unasked(["edge_other", "cable", "pole", "candidate"], LineSet.empty())
    ('cable',)
    """
    there = kinds_in(reference)
    return tuple(
        kind
        for kind in kinds
        if kind != CANDIDATE and (kind not in _WHERE_REFERENCE_HAS_THEM or kind in there)
    )


def scores_of(
    parts: Sequence[KindMatch], *, tolerance_m: float = 0.10, curve_m: Sequence[float] = _CURVE_M
) -> Scores:
    """Return the scores of at least one matched kind: the second half of `evaluate`."""
    return Scores(
        tolerance_m=tolerance_m,
        kinds=tuple(score([part], part.kind, tolerance_m, curve_m) for part in parts),
        overall=score(parts, "overall", tolerance_m, curve_m),
    )


def kinds_in(*sets: LineSet) -> tuple[str, ...]:
    """Return the kinds of all lines in `sets`: known kinds in the order of the layers, then others by name."""
    present = {str(kind) for lines in sets for kind in lines.kind}
    return tuple(k for k in KINDS if k in present) + tuple(sorted(present - set(KINDS)))


def match_kind(extracted: LineSet, reference: LineSet, kind: str, reach_m: float) -> KindMatch:
    """Return the match of the lines of one kind: pieces of both sides, stations and average precision."""
    both = np.concatenate([extracted.xyz, reference.xyz])
    # Close to the lines, so that differences of squares stay exact to micrometres in float64
    origin = np.floor(both.min(axis=0)) if len(both) and np.isfinite(both).all() else np.zeros(3)
    n_dims = 3 if kind in ("cable", POLE) else 2
    e, r = (Chains.of(lines.take(lines.kind == kind), origin, n_dims) for lines in (extracted, reference))
    return KindMatch(
        kind, match_chains(e, r, reach_m), measure_stations(e, r, reach_m), average_precision(e, r)
    )


def score(
    parts: Sequence[KindMatch], name: str, tolerance_m: float, curve_m: Sequence[float] = _CURVE_M
) -> KindScores:
    """Return the measures of one kind, or of several together."""
    matches = [part.match for part in parts]
    stations = Stations.concatenate([part.stations for part in parts])
    measured = stations.take((stations.offset_m <= tolerance_m + TIE_M) & ~stations.is_bridged)
    kinds = {part.kind for part in parts}
    kind = next(iter(kinds)) if len(kinds) == 1 else ""
    far_m, far_p95_m = hausdorff(matches)
    return KindScores(
        kind=name,
        n_extracted=sum(len(m.extracted) for m in matches),
        n_reference=sum(len(m.reference) for m in matches),
        extracted_m=float(sum(m.extracted.length_m.sum() for m in matches)),
        reference_m=float(sum(m.reference.length_m.sum() for m in matches)),
        observed_m=float(sum(m.r_pieces.length_m[m.r_observed].sum() for m in matches)),
        bridged_m=float(sum(m.extracted.lines.bridged_m.sum() for m in matches)),
        n_stations=len(stations),
        n_stations_observed=int(stations.is_observed.sum()),
        at=at_tolerance(parts, stations, tolerance_m),
        curve=tuple(at_tolerance(parts, stations, b) for b in curve_m),
        hausdorff_m=far_m,
        hausdorff_p95_m=far_p95_m,
        chamfer_ap=_mean_precision(parts),
        attributes={name: attribute_errors(matches, name, tolerance_m) for name in ATTRIBUTES},
        sigma_xy=sigma_terciles(measured.lateral_m, measured.sigma_xy_m),
        sigma_z=sigma_terciles(measured.height_m, measured.sigma_z_m),
        confidence=confidence_calibration(matches, tolerance_m),
        bridged=bridged_scores(parts, stations, tolerance_m),
        labels={label: label_scores(matches, label, tolerance_m) for label in COMPARED_LABELS}
        if kind
        else {},
        groups=group_scores(parts, kind, tolerance_m),
        dashes=dash_scores(parts, tolerance_m) if kind == DASH_KIND else None,
    )


def hausdorff(matches: Sequence[PieceMatch]) -> tuple[float | None, float | None]:
    """Return the Hausdorff distance and the larger of the two sides' 95th percentiles [m].

    Distances are from the extracted lines to the whole reference, and from the observed reference to the extracted
    lines. None where a side has no lines.
    """
    to_r = [distance_to(m.e_pieces.xyz, m.reference, COMPARED_PIECE_M) for m in matches]
    to_e = [distance_to(m.r_pieces.xyz[m.r_observed], m.extracted, COMPARED_PIECE_M) for m in matches]
    sides = [np.concatenate(side) for side in (to_r, to_e)]
    if any(len(side) == 0 or not np.isfinite(side).all() for side in sides):
        return None, None
    return float(max(s.max() for s in sides)), float(max(np.percentile(s, 95) for s in sides))


def _mean_precision(parts: Sequence[KindMatch]) -> dict[float, float | None]:
    mean: dict[float, float | None] = {}
    for limit_m in CHAMFER_M:
        defined = [ap for part in parts if (ap := part.chamfer_ap[limit_m]) is not None]
        mean[limit_m] = float(np.mean(defined)) if defined else None
    return mean


def check_crs(extracted: str, reference: str) -> None:
    """Raise unless both sets of lines are in the same CRS.

    Parameters
    ----------
    extracted, reference
        WKT2, or "local". A CRS without a vertical datum matches the same CRS with one (some formats drop
        it): heights are then compared unchanged, with a warning.

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
            f"lines are in {a}, reference in {b} (local: metres, not georeferenced)",
            where="evaluate",
            advice=f"give the CRS of the local file with {argument('crs')}",
        )
    if not same_plan(extracted, reference) or (has_height(extracted) and has_height(reference)):
        raise CrsError(
            f"lines are in {a}, reference in {b}",
            where="evaluate",
            advice="transform one of them",
        )
    stated = a if has_height(extracted) else b
    warnings.warn(
        f"only one of the two states a vertical datum ({stated}): heights are compared unchanged",
        stacklevel=3,
    )
