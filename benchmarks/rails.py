"""How well rails, concrete barriers and fences are found and told apart, form by form.

``python -m benchmarks.rails`` simulates country roads with every form in a row, under usual and hard conditions, and
scores each form within 10 cm: completeness, error across and in height, pieces, and the share of the length found that has
the right form (kind and form; what is on no true rail counts apart). ``--seeds 900-904`` takes other ones, ``--each`` says
it for every scene. Where figures are of seeds that were looked at while something was built, that is to stand beside them.
"""

import argparse
from collections import Counter, defaultdict

import numpy as np

from benchmarks._edge_roles import NOTHING, role_lengths
from benchmarks.accuracy import extracted, seeds_of
from linework.cli.commands.of_lines.evaluate import print_tables
from linework.evaluation.measures import match_lines, score
from linework.evaluation.report.tables import ReportTable, centimetres, number, percent
from linework.simulation.simulate import simulate_survey

#: Minutes: run where it is asked for.
ON_REQUEST = True
TOLERANCE_M = 0.10
KINDS = ("guardrail", "barrier", "fence")


def main(arguments=()):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.rails")
    parser.add_argument("--seeds", default="900-904", help="first-last, or a list")
    parser.add_argument("--roads", default="rails")
    parser.add_argument("--conditions", default="usual,hard")
    parser.add_argument("--length-m", type=float, default=120.0)
    parser.add_argument("--each", action="store_true", help="a table of every scene, too")
    options = parser.parse_args(list(arguments))
    for road in options.roads.split(","):
        for conditions in options.conditions.split(","):
            title = f"{road}, {conditions} conditions"
            pooled = []
            for seed in seeds_of(options.seeds):
                survey = simulate_survey(road, seed, options.length_m, conditions=conditions)
                pooled.append(of_survey(survey))
                if options.each:
                    print_tables([forms_table(f"{title}, seed {seed}", pooled[-1:])])
            print_tables([forms_table(f"{title}, seeds {options.seeds}", pooled)])


def of_survey(survey):
    """Return the matches of each true form, and the metres of what was found by true and found form."""
    found = extracted(survey, survey.trajectory, KINDS).with_columns(crs=survey.crs)
    found, truth = (lines.take(np.isin(lines.kind, KINDS)) for lines in (found, survey.truth))
    matches = {}
    for name in sorted(set(zip(truth.kind.tolist(), truth.form.tolist(), strict=True))):
        own = truth.take((truth.kind == name[0]) & (truth.form == name[1]))
        matches[name] = match_lines(found, own, kinds=name[:1], tolerance_m=TOLERANCE_M)
    return matches, role_lengths(named(found), named(truth), "form")


def named(lines):
    """Return lines whose form is kind and form."""
    names = [f"{kind} {form}".strip() for kind, form in zip(lines.kind, lines.form, strict=True)]
    return lines.with_columns(form=names)


def forms_table(title, surveys):
    """One row per true form, all surveys pooled, and one of what is on no rail."""
    parts, metres = defaultdict(list), Counter()
    for matches, lengths in surveys:
        metres += lengths
        for name, of_name in matches.items():
            parts[name] += of_name
    rows = []
    for name, of_name in sorted(parts.items()):
        one = score(of_name, name[0], TOLERANCE_M)
        true = " ".join(name).strip()
        told = {other: m for (of, other), m in metres.items() if of == true}
        whole = sum(told.values())
        wrong = ", ".join(f"{n} {m:.0f} m" for n, m in Counter(told).most_common() if n != true)
        rows.append(
            (
                true, number(one.observed_m, 0), percent(one.at.completeness),
                centimetres(one.at.lateral.rmse_m), centimetres(one.at.height.rmse_m),
                number(one.at.pieces_per_line, 2),
                percent(told.get(true, 0.0) / whole) if whole else "-", wrong,
            )
        )  # fmt: skip
    false = {other: m for (of, other), m in metres.items() if of == NOTHING}
    told = ", ".join(f"{n} {m:.0f} m" for n, m in Counter(false).most_common())
    whole = sum(metres.values())
    rows.append(
        (
            f"{NOTHING}",
            number(sum(false.values()), 0),
            percent(sum(false.values()) / max(whole, 1e-9)),
            "",
            "",
            "",
            "",
            told,
        )
    )
    columns = (
        "true form",
        "truth\nm",
        "complete",
        "lateral\ncm",
        "height\ncm",
        "pieces",
        "told\nright",
        "told else",
    )
    return ReportTable(title, columns, tuple(rows), "within 10 cm; told: within 0.3 m in plan")


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
