"""Run files: TOML with the settings of a run.

Separate from `linework.model.settings`, which checks the settings: only `files` opens files.
"""

from __future__ import annotations

from pathlib import Path

from linework.files.documents import read_toml
from linework.model.settings import SettingsT, settings_from


def read_settings_file(cls: type[SettingsT], path: Path) -> SettingsT:
    """Return the settings in a run file; what it does not name keeps its default.

    Raises
    ------
    InputError
        Missing, or not a regular file.
    ConfigError
        Not TOML, an unknown key, another type, or a value out of its range; the message names the key.
    """
    return settings_from(cls, read_toml(path), where=path)
