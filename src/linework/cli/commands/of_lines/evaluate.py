"""`linework evaluate`: completeness, correctness and accuracy of lines against a reference."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from linework.cli.options import AsJson, Crs, Overwrite
from linework.cli.said import say, say_json

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from linework.evaluation.report.tables import ReportTable
    from linework.model.lines import LineSet

#: Width of tables without a terminal [characters]: the widest table of an evaluation fits.
_PLAIN_WIDTH = 160
#: Names of a reference listed in a message.
_MAX_NAMES = 12


def evaluate_command(
    lines: Annotated[Path, typer.Argument(metavar="LINES", help="Extracted lines.")],
    reference: Annotated[Path, typer.Argument(metavar="REFERENCE", help="Reference lines.")],
    tolerance_m: Annotated[
        float, typer.Option("--tolerance-m", help="Distance within which a line counts as found [m].")
    ] = 0.10,
    dash_end_m: Annotated[
        float,
        typer.Option(
            "--dash-end-m",
            help="Tolerance for the ends of dashes [m]; give the scan-line spacing where that is larger.",
        ),
    ] = 0.10,
    as_json: AsJson = False,
    picture: Annotated[
        Path | None,
        typer.Option("--picture", metavar="FILE", help="Also draw found, missed and wrong lines: .png."),
    ] = None,
    kinds: Annotated[
        str, typer.Option("--kinds", metavar="KIND,...", help="Score these kinds only, e.g. guardrail,cable.")
    ] = "",
    kind_field: Annotated[
        str, typer.Option("--kind-field", help="Field of the reference that holds the kind of a line.")
    ] = "kind",
    kind_map: Annotated[
        str,
        typer.Option(
            "--kind-map",
            metavar="NAME=KIND,...",
            help="Kinds that names in the reference stand for, e.g. SOLID_WHITE=lane_marking,edge=road_boundary. "
            "Names are looked up in --kind-field, then in the field kind; other lines are ignored.",
        ),
    ] = "",
    crs: Crs = None,
    overwrite: Overwrite = False,
) -> None:
    """Score LINES against REFERENCE.

    Reports completeness, correctness, quality, and lateral and height errors. Scores the kinds that both files hold.
    An empty layer counts as holding its kind, so a kind of which nothing was found is scored too; but edges beside
    boundaries and poles are scored only where REFERENCE has some, or where --kinds names them.
    """
    from linework.errors import PartialError, UsageError, check_extra
    from linework.evaluation.measures import match_lines, scores_of
    from linework.files.output.locks import reserve_output

    if picture is not None:
        if picture.suffix.lower() != ".png":
            raise UsageError(f"cannot write pictures as '{picture.suffix}'", where=picture, advice="use .png")
        check_extra("reports", where="--picture")
    left_out: list[str] = []
    with contextlib.ExitStack() as stack:
        if picture is not None:
            stack.enter_context(reserve_output(picture, overwrite=overwrite, inputs=[lines, reference]))
        names = _parsed_map(kind_map)
        found = _read(lines, "kind", {}, crs, left_out)
        truth = _read(reference, kind_field, names, crs, left_out)
        held = (_kinds_held(lines, found, {}), _kinds_held(reference, truth, names))
        chosen = _requested_kinds(kinds, held) if kinds else _shared_kinds(lines, reference, held, truth)
        _report_not_scored(chosen, found, truth)
        parts = match_lines(found, truth, tolerance_m=tolerance_m, kinds=chosen, dash_end_m=dash_end_m)
        scores = scores_of(parts, tolerance_m=tolerance_m)
        if picture is not None:
            from linework.evaluation.report.scores_figure import hits_figure, plot_png
            from linework.files.output.publish import write_bytes

            write_bytes(plot_png(hits_figure(parts, tolerance_m)), picture, overwrite=overwrite)
    if as_json:
        say_json(scores.to_dict())
    else:
        from linework.evaluation.report.tables import score_tables

        print_tables(score_tables(scores))
    if left_out:
        raise PartialError("; ".join(left_out), advice="the other lines are scored")


def _parsed_map(text: str) -> dict[str, str]:
    """Return the kinds of --kind-map by name."""
    from linework.errors import UsageError
    from linework.model.lines import KINDS, POLE

    known = (*KINDS, POLE)
    names: dict[str, str] = {}
    for entry in filter(None, (part.strip() for part in text.split(","))):
        name, equals, kind = (part.strip() for part in entry.partition("="))
        if not (equals and name):
            raise UsageError(
                f"'{entry}' is not NAME=KIND",
                where="--kind-map",
                advice="give pairs such as a=guardrail,b=cable",
            )
        if kind not in known:
            raise UsageError(
                f"unknown kind '{kind}'", where="--kind-map", advice=f"choose from {', '.join(known)}"
            )
        names[name] = kind
    return names


def _read(
    path: Path, kind_field: str, names: Mapping[str, str], crs: str | None, left_out: list[str]
) -> LineSet:
    """Read lines, with the kinds of `names` where given; lines of other names are dropped."""
    import numpy as np

    from linework.errors import InputError
    from linework.files.vectors.read_write import read_usable_lines
    from linework.lines.units import in_metres

    lines, problem = read_usable_lines(path, crs=crs)
    left_out += [problem] if problem else []
    lines = in_metres(lines)
    if kind_field == "kind" and not names:
        return lines
    own = lines.kind
    if kind_field != "kind":
        # Files of other programs are read in file order, whichever field is read: the rows correspond
        own = read_usable_lines(path, kind_field=kind_field, crs=crs)[0].kind
    if not names:
        return lines.with_columns(kind=own)
    kind = np.array(
        [names.get(str(a)) or names.get(str(b), "") for a, b in zip(own, lines.kind, strict=True)],
        dtype=np.str_,
    )
    if not (kind != "").any():
        present = sorted({str(k) for k in [*own, *lines.kind] if k})
        shown = ", ".join(present[:_MAX_NAMES]) + (" ..." if len(present) > _MAX_NAMES else "")
        raise InputError(
            f"no line has a name of --kind-map; names in the file: {shown or 'none'}",
            where=path,
            advice="check --kind-field and --kind-map",
        )
    return lines.with_columns(kind=kind).take(kind != "")


def _kinds_held(path: Path, lines: LineSet, names: Mapping[str, str]) -> set[str]:
    """Return the kinds of a file: those of its lines, of its empty layers, and of --kind-map."""
    from linework.files.vectors.gpkg import geometry_layers

    held = {str(kind) for kind in lines.kind} | set(names.values())
    if path.suffix.lower() == ".gpkg" and not names:
        held |= geometry_layers(path)
    return held


def _shared_kinds(
    lines: Path, reference: Path, held: tuple[set[str], set[str]], truth: LineSet
) -> tuple[str, ...]:
    from linework.errors import InputError
    from linework.evaluation.measures import scored_unasked
    from linework.model.lines import KINDS

    shared = held[0] & held[1]
    in_order = (*(k for k in KINDS if k in shared), *sorted(shared - set(KINDS)))
    scored = scored_unasked(in_order, truth)
    if not scored:
        a, b = (", ".join(sorted(kinds)) or "no lines" for kinds in held)
        raise InputError(
            f"no kind in common: the lines hold {a}, {reference.name} holds {b}",
            where=lines,
            advice="map the names with --kind-map, or choose with --kinds",
        )
    return scored


def _requested_kinds(text: str, held: tuple[set[str], set[str]]) -> tuple[str, ...]:
    from linework.errors import UsageError
    from linework.model.lines import KINDS, POLE

    requested = tuple(dict.fromkeys(filter(None, (part.strip() for part in text.split(",")))))
    known = {*KINDS, POLE} | held[0] | held[1]
    unknown = [kind for kind in requested if kind not in known]
    if unknown or not requested:
        raise UsageError(
            f"unknown kind '{', '.join(unknown)}'",
            where="--kinds",
            advice=f"choose from {', '.join(sorted(known))}",
        )
    return requested


def _report_not_scored(chosen: Sequence[str], found: LineSet, truth: LineSet) -> None:
    """Print on stderr the kinds that are not scored."""
    for name, lines in (("LINES", found), ("REFERENCE", truth)):
        others = sorted({str(kind) for kind in lines.kind} - set(chosen))
        if others:
            say(f"note: not scored in {name}: {', '.join(others)}", to_stderr=True)


def print_tables(tables: Iterable[ReportTable]) -> None:
    """Print tables on stdout, as wide as the terminal, or as wide as they need where there is none."""
    # Imported here: it would double the time of `linework --help`
    from rich import box
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from linework.errors import printable

    console = Console(file=sys.stdout, width=None if sys.stdout.isatty() else _PLAIN_WIDTH, highlight=False)
    for table in tables:
        shown = Table(
            title=Text(printable(table.title)), caption=Text(printable(table.note)) if table.note else None, box=box.SIMPLE_HEAD,
            title_justify="left", caption_justify="left", pad_edge=False,
        )  # fmt: skip
        for i, name in enumerate(table.columns):
            shown.add_column(Text(printable(name)), justify="left" if i == 0 else "right", no_wrap=i == 0)
        for row in table.rows:
            shown.add_row(*(Text(printable(value)) for value in row))
        console.print(shown)
