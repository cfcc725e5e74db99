"""`linework config`: the default run file, with the unit and reason of every setting.

Separate from the other commands: each has a file of its own.
"""

from __future__ import annotations

from typing import Annotated

import typer

from linework.cli.said import say


def config(
    method: Annotated[
        str, typer.Argument(metavar="METHOD", help="Print the settings of this method only; default: all.")
    ] = "",
) -> None:
    """Print the default run file: all settings.

    Each setting has its unit and reason. The output is TOML: save it, edit it, and pass it to other commands
    with --config.
    """
    from dataclasses import fields

    from linework.errors import UsageError
    from linework.model.settings import settings_toml
    from linework.runs.settings import RunSettings

    names = [f.name for f in fields(RunSettings)]
    if method and method not in names:
        raise UsageError(
            f"unknown method '{method}'", where="config", advice=f"choose from {', '.join(names)}"
        )
    settings = RunSettings()
    for name in [method] if method else names:
        say(f"[{name}]")
        say(*settings_toml(getattr(settings, name), f"{name}.").splitlines())
