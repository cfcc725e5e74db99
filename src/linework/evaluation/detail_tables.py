"""Tables of what only some kinds have: groups, words, dashes, bridged stretches."""

from __future__ import annotations

from collections.abc import Sequence

from linework.evaluation.groups import GROUPED_BY
from linework.evaluation.scores import KindScores
from linework.evaluation.table_texts import TextTable, centimetres, error_texts, number, percent, ratio_texts


def groups_table(rows: Sequence[KindScores]) -> TextTable:
    """Return the measures of boundaries by form and of markings by pattern."""
    columns = (
        "kind", "of", "truth m", "seen m", "complete", "correct", "double", "pieces", "lateral\nbias", "\nRMSE",
        "\nmedian", "\n95 %", "measured\nRMSE", "height\nRMSE", "step\nRMSE",
    )  # fmt: skip
    texts = [
        (
            row.kind, f"{GROUPED_BY[row.kind]} {group.value or '-'}", f"{group.reference_m:.1f}",
            f"{group.observed_m:.1f}", percent(group.at.completeness), percent(group.at.correctness),
            percent(group.at.redundancy), number(group.at.pieces_per_line, 2), *error_texts(group.at.lateral),
            centimetres(group.bridged.lateral_measured.rmse_m), centimetres(group.at.height.rmse_m), centimetres(group.height.rmse_m),
        )
        for row in rows
        for group in row.groups
    ]  # fmt: skip
    note = (
        "errors in cm; what was extracted counts to the group of the truth beside it, or else to its own; "
        "measured: lateral, bridged stretches left out; step: height_m of the line"
    )
    return TextTable("Apart", columns, tuple(texts), note)


def labels_table(rows: Sequence[KindScores]) -> TextTable:
    """Return for what length the words of the lines are right."""
    texts = []
    for row in rows:
        for name, label in row.labels.items():
            if label.compared_m > 0:
                mistaken = [
                    f"{text} {percent(size_m / label.compared_m)}"
                    for text, size_m in label.mistaken_m.items()
                ]
                texts.append(
                    (
                        row.kind,
                        name,
                        f"{label.compared_m:.1f}",
                        percent(label.share_right),
                        ", ".join(mistaken[:3]),
                    )
                )
    columns = ("kind", "of", "compared m", "right", "mistaken most (truth > said)")
    return TextTable(
        "Words of the lines", columns, tuple(texts), "over the truth that was found and has such a word"
    )


def dashes_table(rows: Sequence[KindScores]) -> TextTable:
    """Return how many dashes were found and how exact their ends are."""
    columns = (
        "kind", "truth seen", "found", "", "extracted", "right", "ends", "within", "end cm\nbias", "\nRMSE",
        "\nmedian", "\n95 %",
    )  # fmt: skip
    texts = [
        (
            row.kind, str(d.n_reference), str(d.n_found), percent(d.share_found), str(d.n_extracted),
            percent(d.share_right), str(d.ends.n), percent(d.share_ends_within), *error_texts(d.ends),
        )
        for row in rows
        if (d := row.dashes) is not None and (d.n_reference or d.n_extracted)
    ]  # fmt: skip
    limits = {100 * row.dashes.end_limit_m for row in rows if row.dashes is not None}
    note = f"within {' '.join(f'{cm:.0f}' for cm in sorted(limits))} cm; end errors: positive where it is too long"
    return TextTable("Dashes", columns, tuple(texts), note)


def bridged_table(rows: Sequence[KindScores]) -> TextTable:
    """Return how much was carried over gaps and how well, beside what was measured."""
    columns = (
        "kind", "hidden m", "found of it", "bridged m", "right", "lateral cm\nRMSE", "\n95 %",
        "measured\nRMSE cm", "sigma xy", "sigma z",
    )  # fmt: skip
    texts = [
        (
            row.kind, f"{b.hidden_m:.1f}", percent(b.hidden_found_m / b.hidden_m if b.hidden_m else None),
            f"{b.bridged_m:.1f}", percent(b.share_right), centimetres(b.lateral.rmse_m),
            centimetres(b.lateral.p95_m), centimetres(b.lateral_measured.rmse_m), ratio_texts(b.sigma_xy),
            ratio_texts(b.sigma_z),
        )
        for row in rows
        if (b := row.bridged).bridged_m or b.hidden_m
    ]  # fmt: skip
    note = (
        "hidden: truth that could not be seen; right: part of the bridged length within the tolerance; lateral: "
        "of bridged stretches, however far off within the search; sigma as below, on bridged stretches"
    )
    return TextTable("Bridged", columns, tuple(texts), note)
