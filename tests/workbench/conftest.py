"""A simulated drive with points, images and logs, made once for all tests of the workbench, and its lines."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from linework.files.locks import locked


def _made_once(
    factory: pytest.TempPathFactory, name: str, make: Callable[[Path], None], *, is_file: bool = False
) -> Path:
    """Return what all workers of a test run share: made by the first that asks."""
    # Workers of one run have folders of their own in one for the run
    base = factory.getbasetemp()
    shared = (base.parent if base.name.startswith("popen-") else base) / "workbench"
    shared.mkdir(exist_ok=True)
    path = shared / name
    with locked(shared / f"{name}.lock", keep=True):
        if not path.exists():
            part = shared / f"part-{name}"
            make(part)
            part.rename(path)
    return path


@pytest.fixture(scope="session")
def made_drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a simulated urban drive of 48 m: points, images, logs, truth. Not to be changed: see `drive`."""
    from linework.cli.app import main

    def make(part: Path) -> None:
        arguments = ["--seed", "974", "--length-m", "48", "--road", "urban", "--image-size", "732x484",
                     "--image-every-m", "6", "--points-per-m", "3000", "--quiet"]  # fmt: skip
        assert main(["simulate", "-o", str(part), *arguments]) == 0

    return _made_once(tmp_path_factory, "drive", make)


@pytest.fixture(scope="session")
def made_lines(made_drive: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the lines that `linework extract` finds in the drive's points."""
    from linework.cli.app import main

    def make(part: Path) -> None:
        part.mkdir()
        work = made_drive / ".linework"
        arguments = ["-o", str(part / "lines.gpkg"), "--work", str(work), "--workers", "1", "--quiet"]
        assert main(["extract", str(made_drive), "--method", "obb", *arguments]) == 0

    return _made_once(tmp_path_factory, "extracted", make) / "lines.gpkg"


@pytest.fixture
def drive(made_drive: Path, made_lines: Path, tmp_path: Path) -> Iterator[Path]:
    """Return a copy of the drive for one test, its points decoded already (`.linework`), with no lines."""
    copy = tmp_path / "drive"
    shutil.copytree(made_drive, copy)
    yield copy
    shutil.rmtree(copy)


@pytest.fixture
def drive_lines(drive: Path, made_lines: Path) -> Path:
    """Return the drive's own file of lines, as `extract` made it."""
    return Path(shutil.copy(made_lines, drive / "lines.gpkg"))
