"""Arguments and options that several commands share, and the values read from them.

Each is written once, so that a name, its help and its type are the same in every command. A command module
must import these names at run time, not under TYPE_CHECKING: typer resolves them.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from linework.runs.settings import RunSettings

SurveyArgument = Annotated[
    list[Path],
    typer.Argument(
        metavar="SURVEY",
        help="LAS, LAZ, PLY or PCD files, a folder of them, a survey folder, or a KITTI drive; LAS or LAZ at an address.",
    ),
]
#: Commands that write other files than lines say which in an option of their own.
LinesOutput = Annotated[
    Path,
    typer.Option(
        "--output",
        "-o",
        metavar="LINES",
        help="Output file: .gpkg, .geojson, .parquet, .dxf, .landxml, .osm, .xodr, ...",
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace existing output.")]
Crs = Annotated[
    str | None,
    typer.Option(
        "--crs", metavar="CRS", help="CRS of files that do not state one: EPSG:CODE, or local (metres)."
    ),
]
WithLanes = Annotated[
    bool,
    typer.Option(
        "--lanes", help="Also write the lanes that the lines bound: .gpkg, .geojson, .osm (lanelets), .xodr."
    ),
]
Location = Annotated[
    str,
    typer.Option("--location", help="Of the lanelets of an .osm: urban, nonurban or private."),
]
AllowOutside = Annotated[
    bool, typer.Option("--allow-outside", help="Let survey.toml name files outside its folder.")
]
AllowRemote = Annotated[
    bool, typer.Option("--allow-remote", help="Let survey.toml name points at addresses (https, s3).")
]
TrajectoryFile = Annotated[
    Path | None,
    typer.Option(
        "--trajectory",
        metavar="FILE",
        help="Trajectory of the vehicle origin, not of an antenna; replaces the survey's own.",
    ),
]
WorkFolder = Annotated[
    Path | None,
    typer.Option(
        "--work",
        metavar="DIR",
        help="Work folder for the tile store and unfinished runs; default: .linework beside the survey.",
    ),
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", min=1, max=256, help="Number of worker processes; default: all cores."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Dask scheduler of a cluster that runs the tiles: tcp://HOST:PORT; local: one on this machine.",
    ),
]
RunFile = Annotated[
    Path | None,
    typer.Option(
        "--config", metavar="FILE", help="Run file (TOML) with settings; `linework config` prints one."
    ),
]
SetValues = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="NAME=VALUE", help="One setting, such as radon.cell_m=0.1; may be repeated."
    ),
]
#: Options that are not named as the parameter is in Python.
_OPTION_OF = {
    "kinds": "--features",
    "kind": "--feature",
    "methods": "--method",
    "settings": "--config",
    "paint": "--paint-column",
}


def option_words(name: str, value: str | int | bool | None) -> str:
    """Return a parameter as the option of a command, for `linework.errors.LineworkError.line`.

    >>> option_words("overwrite", True), option_words("crs", "local"), option_words("kinds", None)
    ('--overwrite', '--crs local', '--features')
    """
    option = _OPTION_OF.get(name) or "--" + name.replace("_", "-")
    return option if value is None or value is True else f"{option} {value}"


AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Do not show progress.")]


def read_settings(path: Path | None, assignments: list[str] | None = None) -> RunSettings:
    """Return the settings of a run file and of `--set`; settings that neither names keep their defaults.

    Raises
    ------
    ConfigError
        The file is not TOML, or a setting is unknown, of the wrong type or out of range.
    InputError
        The file cannot be read.
    UsageError
        An assignment is not NAME=VALUE.
    """
    from linework.files.settings_file import settings_with
    from linework.runs.settings import RunSettings

    return settings_with(RunSettings, path, assignments or ())
