"""`linework evaluate`: how complete, how correct and how exact lines are, against reference lines."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from linework.evaluation.report.tables import ReportTable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from linework.model.lines import LineSet


def evaluate(
    lines: Annotated[Path, typer.Argument(metavar="LINES", help="Extracted lines.")],
    reference: Annotated[Path, typer.Argument(metavar="REFERENCE", help="Lines that are right.")],
    tolerance_m: Annotated[
        float, typer.Option("--tolerance-m", help="Distance within which a line counts as found.")
    ] = 0.10,
    dash_end_m: Annotated[
        float,
        typer.Option(
            "--dash-end-m", help="How far the end of a dash may be off: the spacing of scan lines if wider."
        ),
    ] = 0.10,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="PNG of what was found, missed and wrong.")
    ] = None,
    kinds: Annotated[
        str, typer.Option("--kinds", help="Score these kinds only, for example guardrail,cable.")
    ] = "",
    kind_field: Annotated[
        str, typer.Option("--kind-field", help="Property of the reference that says what a line is.")
    ] = "kind",
    kind_map: Annotated[
        str,
        typer.Option(
            "--kind-map",
            help="Names in the reference and what they are here: SOLID_WHITE=lane_marking,edge=road_boundary. "
            "Looked up in --kind-field, then in the property kind; other lines are left out.",
        ),
    ] = "",
    crs: Annotated[
        str, typer.Option("--crs", help="EPSG:... or local: the CRS where a file does not say.")
    ] = "",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the picture.")] = False,
) -> None:
    """Score LINES against REFERENCE: completeness, correctness, quality, lateral and height errors.

    Scored are the kinds that both files hold (an empty layer counts: nothing found is a score, too).
    """
    from linework.errors import UsageError
    from linework.evaluation.measures import match_lines, scores_of
    from linework.files.output.publish import check_output

    if picture is not None:
        if picture.suffix.lower() != ".png":
            raise UsageError("pictures are .png files", where=picture, advice="name it something.png")
        check_output(picture, overwrite=overwrite)
    names = _parsed_map(kind_map)
    found = _read(lines, "kind", {}, crs)
    truth = _read(reference, kind_field, names, crs)
    held = (_kinds_held(lines, found, {}), _kinds_held(reference, truth, names))
    chosen = _asked_kinds(kinds, held) if kinds else _shared_kinds(lines, reference, held)
    _tell_left_out(chosen, found, truth)
    parts = match_lines(found, truth, tolerance_m=tolerance_m, kinds=chosen, dash_end_m=dash_end_m)
    scores = scores_of(parts, tolerance_m=tolerance_m)
    if picture is not None:
        from linework.evaluation.report.scores_figure import hits_figure, plot_png
        from linework.files.output.publish import write_bytes

        write_bytes(plot_png(hits_figure(parts, tolerance_m)), picture, overwrite=overwrite)
    if as_json:
        import json

        typer.echo(json.dumps(scores.to_dict(), indent=1, allow_nan=False))
    else:
        from linework.evaluation.report.tables import score_tables

        print_tables(score_tables(scores))


def _parsed_map(text: str) -> dict[str, str]:
    """Return the names of --kind-map and the kinds they stand for."""
    from linework.errors import UsageError
    from linework.model.lines import KINDS

    names: dict[str, str] = {}
    for entry in filter(None, (part.strip() for part in text.split(","))):
        name, equals, kind = (part.strip() for part in entry.partition("="))
        if not (equals and name):
            raise UsageError(
                f"'{entry}' is not NAME=KIND", where="--kind-map", advice="write a=guardrail,b=cable"
            )
        if kind not in KINDS:
            raise UsageError(
                f"kind '{kind}' is unknown", where="--kind-map", advice=f"known: {', '.join(KINDS)}"
            )
        names[name] = kind
    return names


def _read(path: Path, kind_field: str, names: Mapping[str, str], crs: str) -> LineSet:
    """Read lines; with `names` those of other names fall away."""
    import numpy as np

    from linework.errors import InputError
    from linework.files.geodesy.crs import LOCAL, parse_crs
    from linework.files.vectors.read_write import read_lines

    lines = read_lines(path, crs=crs or None)
    if crs and lines.crs == LOCAL:
        lines = lines.with_columns(crs=parse_crs(crs, where="--crs"))
    if kind_field == "kind" and not names:
        return lines
    own = lines.kind
    if kind_field != "kind":
        # Files of others come back in the order they are in, whatever property is looked at
        own = read_lines(path, kind_field=kind_field, crs=crs or None).kind
    if not names:
        return lines.with_columns(kind=own)
    kind = np.array(
        [names.get(str(a)) or names.get(str(b), "") for a, b in zip(own, lines.kind, strict=True)],
        dtype=np.str_,
    )
    if not (kind != "").any():
        there = sorted({str(k) for k in [*own, *lines.kind] if k})
        shown = ", ".join(there[:12]) + (" ..." if len(there) > 12 else "")
        raise InputError(
            f"no line has a name of --kind-map; its names are: {shown or 'none'}",
            where=path,
            advice="see --kind-field and --kind-map",
        )
    return lines.with_columns(kind=kind).take(kind != "")


def _kinds_held(path: Path, lines: LineSet, names: Mapping[str, str]) -> set[str]:
    """Return the kinds a file can hold: those of its lines, its empty layers, what its names stand for."""
    import pyogrio  # its limits were set when the lines were read

    from linework.files.vectors.fields import REJECTED_LAYER

    held = {str(kind) for kind in lines.kind} | set(names.values())
    if path.suffix.lower() == ".gpkg" and not names:
        held |= {
            str(name) for name, geometry in pyogrio.list_layers(path) if geometry and name != REJECTED_LAYER
        }
    return held


def _shared_kinds(lines: Path, reference: Path, held: tuple[set[str], set[str]]) -> tuple[str, ...]:
    from linework.errors import InputError
    from linework.model.lines import KINDS

    shared = held[0] & held[1]
    if not shared:
        a, b = (", ".join(sorted(kinds)) or "no lines" for kinds in held)
        raise InputError(
            f"no kind in common: it holds {a}; {reference.name} holds {b}",
            where=lines,
            advice="give --kind-map to say what the names mean, or --kinds",
        )
    return tuple(k for k in KINDS if k in shared) + tuple(sorted(shared - set(KINDS)))


def _asked_kinds(text: str, held: tuple[set[str], set[str]]) -> tuple[str, ...]:
    from linework.errors import UsageError
    from linework.model.lines import KINDS

    asked = tuple(dict.fromkeys(filter(None, (part.strip() for part in text.split(",")))))
    known = set(KINDS) | held[0] | held[1]
    unknown = [kind for kind in asked if kind not in known]
    if unknown or not asked:
        raise UsageError(
            f"kind '{', '.join(unknown)}' is unknown",
            where="--kinds",
            advice=f"known: {', '.join(sorted(known))}",
        )
    return asked


def _tell_left_out(chosen: Sequence[str], found: LineSet, truth: LineSet) -> None:
    """Say on stderr which lines take no part."""
    for name, lines in (("LINES", found), ("REFERENCE", truth)):
        others = sorted({str(kind) for kind in lines.kind} - set(chosen))
        if others:
            typer.echo(f"note: not scored, from {name}: {', '.join(others)}", err=True)


# Print tables on stdout: as wide as the terminal, or as wide as they need to be in a file

#: Without a terminal a table may have this many characters in a row.
PLAIN_WIDTH = 160


def print_tables(tables: Iterable[ReportTable]) -> None:
    """Print tables one after another."""
    console = Console(file=sys.stdout, width=None if sys.stdout.isatty() else PLAIN_WIDTH, highlight=False)
    for table in tables:
        shown = Table(
            title=Text(table.title), caption=Text(table.note) if table.note else None, box=box.SIMPLE_HEAD,
            title_justify="left", caption_justify="left", pad_edge=False,
        )  # fmt: skip
        for i, name in enumerate(table.columns):
            shown.add_column(Text(name), justify="left" if i == 0 else "right", no_wrap=i == 0)
        for row in table.rows:
            shown.add_row(*(Text(value) for value in row))
        console.print(shown)
