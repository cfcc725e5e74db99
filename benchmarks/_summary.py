"""Tables that only a benchmark has: the variants of a survey beside each other, and confidence over them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from linework.evaluation.calibration import confidence_calibration
from linework.evaluation.report.tables import ReportTable, centimetres, number, percent, ratio_texts
from linework.evaluation.tolerance import KindMatch, ratio
from linework.evaluation.values import GroupScores, KindScores, Scores


def summary_table(scores: Mapping[str, Scores]) -> ReportTable:
    """Return the main figures of every kind and group, variant by variant."""
    rows = []
    for kind in next(iter(scores.values())).kinds:
        groups = [group.value for group in kind.groups]
        for variant, of_variant in scores.items():
            rows.append((kind.kind, variant, *_of_kind(of_variant[kind.kind])))
        rows += [
            (f"  {value or '-'}", variant, *_of_group(group))
            for value in groups
            for variant, of_variant in scores.items()
            for group in of_variant[kind.kind].groups
            if group.value == value
        ]
    columns = (
        "kind", "variant", "complete", "correct", "double", "pieces", "measured\ncm", "height\ncm",
        "height_m\ncm", "pattern", "role", "dashes\nfound", "ends\nwithin", "sigma xy",
    )  # fmt: skip
    return ReportTable("Variants", columns, tuple(rows), "measured: lateral RMSE, bridged stretches left out")


def _of_kind(row: KindScores) -> tuple[str, ...]:
    pattern, role = (row.labels[name].share_right if row.labels else None for name in ("pattern", "role"))
    return (
        percent(row.at.completeness), percent(row.at.correctness), percent(row.at.redundancy),
        number(row.at.pieces_per_line, 2), centimetres(row.bridged.lateral_measured.rmse_m),
        centimetres(row.at.height.rmse_m), centimetres(row.attributes["height_m"].rmse_m), percent(pattern),
        percent(role), percent(row.dashes.share_found if row.dashes else None),
        percent(row.dashes.share_ends_within if row.dashes else None), ratio_texts(row.sigma_xy),
    )  # fmt: skip


def _of_group(group: GroupScores) -> tuple[str, ...]:
    return (
        percent(group.at.completeness), percent(group.at.correctness), percent(group.at.redundancy),
        number(group.at.pieces_per_line, 2), centimetres(group.bridged.lateral_measured.rmse_m),
        centimetres(group.at.height.rmse_m), centimetres(group.height.rmse_m), "", "", "", "", "",
    )  # fmt: skip


def confidence_table(parts: Sequence[KindMatch], tolerance_m: float) -> ReportTable:
    """Return per kind and class of confidence how sure pieces of 10 m were said to be, and were."""
    rows = []
    for kind in dict.fromkeys(part.kind for part in parts):
        judged = confidence_calibration([part.match for part in parts if part.kind == kind], tolerance_m)
        rows.append(
            (
                kind, str(judged.n_pieces), percent(ratio(judged.n_correct, judged.n_pieces)), "all",
                percent(judged.calibration_error), number(judged.auc, 3),
            )
        )  # fmt: skip
        rows += [("", str(c.n), percent(c.was), percent(c.said), "", "") for c in judged.classes]
    columns = ("kind", "pieces", "right", "said", "calibration error", "AUC")
    return ReportTable("Confidence per piece of 10 m", columns, tuple(rows))
