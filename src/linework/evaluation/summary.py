"""The scores of an evaluation as short text and as a pandas frame.

Separate from `linework.evaluation.values`, which would be too long with it.
"""

from __future__ import annotations

from typing import Any

from linework.errors import needed
from linework.evaluation.values import KindScores, Scores, ToleranceScores

#: Kinds in the text of scores: a title, a header and what only one side has make ten lines with them.
_MOST_KINDS = 7
#: Characters of a kind that are shown.
_LONGEST_KIND = 30
#: Columns of the frame that are whole numbers.
_COUNTS = ["n_found", "n_truth", "n_missed"]


def text_of_scores(scores: Scores) -> str:
    """Return at most ten lines about the scores: `repr` of `Scores`."""
    titles = ("", "completeness", "correctness", "lateral rmse", "height rmse", "truth", "found")
    shown = scores.kinds if len(scores.kinds) <= _MOST_KINDS else scores.kinds[: _MOST_KINDS - 1]
    rows = [titles, *(_cells(one) for one in shown)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(titles))]
    texts = [f"Scores at {scores.tolerance_m:g} m: {figures_text(scores.overall)}"]
    for name, *cells in rows:
        padded = (f"{cell:>{width}}" for cell, width in zip(cells, widths[1:], strict=True))
        texts.append("  ".join(["", f"{name:<{widths[0]}}", *padded]))
    if len(shown) < len(scores.kinds):
        texts.append(f"  and {len(scores.kinds) - len(shown)} more kinds")
    only = [("nothing found of", scores.missed), ("none in the truth of", scores.unexpected)]
    listed = "; ".join(f"{what}: {', '.join(map(_name, kinds))}" for what, kinds in only if kinds)
    return "\n".join([*texts, *([f"  {listed}"] if listed else [])])


def figures_text(scores: KindScores) -> str:
    """Return the three figures that matter most."""
    _, complete, correct, lateral, *_ = _cells(scores)
    return f"completeness {complete}, correctness {correct}, lateral rmse {lateral}"


def _cells(scores: KindScores) -> tuple[str, ...]:
    """Return the cells of a kind in the text of scores; "-" where undefined."""
    shares = [
        "-" if v is None else f"{100 * v:.1f} %" for v in (scores.at.completeness, scores.at.correctness)
    ]
    errors = ["-" if e.rmse_m is None else f"{e.rmse_m:.3f} m" for e in (scores.at.lateral, scores.at.height)]
    lengths = [f"{length_m:,.1f} m" for length_m in (scores.reference_m, scores.extracted_m)]
    return _name(scores.kind), *shares, *errors, *lengths


def _name(kind: str) -> str:
    """Return a kind on one line."""
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in kind) or "(no kind)"
    return text[:_LONGEST_KIND]


def frame_of_scores(scores: Scores, *, curve: bool) -> Any:
    """Return the main figures as a `pandas.DataFrame`: the work of `Scores.to_frame`."""
    pandas = needed("pandas", "tables", where="to_frame()")
    rows = []
    for one in (*scores.kinds, scores.overall):
        at = {part.tolerance_m: part for part in ((*one.curve, one.at) if curve else (one.at,))}
        rows += [_row(one, at[tolerance_m]) for tolerance_m in sorted(at)]
    frame = pandas.DataFrame(rows)
    # None is NaN in a column of numbers
    numbers = frame.columns.difference(["kind"])
    frame[numbers] = frame[numbers].astype(float)
    frame[_COUNTS] = frame[_COUNTS].astype(int)
    return frame.set_index(["kind", "tolerance_m"] if curve else "kind")


def _row(scores: KindScores, at: ToleranceScores) -> dict[str, Any]:
    """Return the main figures of a kind at a tolerance by name."""
    errors = {
        f"{name}_{figure}": getattr(stats, figure)
        for name, stats in (("lateral", at.lateral), ("height", at.height), ("space", at.space))
        for figure in ("bias_m", "rmse_m", "median_m", "p95_m")
        if (name, figure) != ("space", "bias_m")  # distances have no sign
    }
    return {
        "kind": scores.kind,
        "tolerance_m": at.tolerance_m,
        "n_found": scores.n_extracted,
        "n_truth": scores.n_reference,
        "found_m": scores.extracted_m,
        "truth_m": scores.reference_m,
        "observed_m": scores.observed_m,
        "bridged_m": scores.bridged_m,
        "completeness": at.completeness,
        "completeness_all": at.completeness_all,
        "correctness": at.correctness,
        "quality": at.quality,
        "redundancy": at.redundancy,
        "gaps_per_km": at.gaps_per_km,
        "pieces_per_line": at.pieces_per_line,
        "n_missed": at.n_missed,
        **errors,
        "hausdorff_m": scores.hausdorff_m,
    }
