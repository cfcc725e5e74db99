"""A simulated drive with points, images and logs, made once for all tests of the workbench, and its lines."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from tests.workbench.serve_process import Served, opened_browser, opened_page, served_survey

from linework.files.output.locks import hold_lock


def _made_once(
    factory: pytest.TempPathFactory, name: str, make: Callable[[Path], None], *, is_file: bool = False
) -> Path:
    """Return what all workers of a test run share: made by the first that asks."""
    # Workers of one run have folders of their own in one for the run
    base = factory.getbasetemp()
    shared = (base.parent if base.name.startswith("popen-") else base) / "workbench"
    shared.mkdir(exist_ok=True)
    path = shared / name
    with hold_lock(shared / f"{name}.lock", keep=True):
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


@pytest.fixture(scope="module")
def served(made_drive: Path, made_lines: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """Return a real server of a copy of the drive and its lines, for all tests of a module, logged in."""
    with _served_copy(made_drive, made_lines, tmp_path_factory) as served:
        yield served


@pytest.fixture
def served_alone(
    made_drive: Path, made_lines: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Served]:
    """Return as `served`, for one test, which may do with it what it likes."""
    with _served_copy(made_drive, made_lines, tmp_path_factory) as served:
        yield served


@contextmanager
def _served_copy(drive: Path, lines: Path, factory: pytest.TempPathFactory) -> Iterator[Served]:
    survey = factory.mktemp("served") / "drive"
    shutil.copytree(drive, survey)
    shutil.copy(lines, survey / "lines.gpkg")
    with served_survey(survey) as served:
        yield served
    shutil.rmtree(survey)


@pytest.fixture(scope="module")
def browser(request: pytest.FixtureRequest) -> Iterator[Any]:
    """Return a Chromium; of a module, as its loop would be in the way of other modules' own.

    It draws in three dimensions for a module that says so: `DRAWS_3D = True`.
    """
    with opened_browser(draws_3d=getattr(request.module, "DRAWS_3D", False)) as browser:
        yield browser


@pytest.fixture
def page(browser: Any, served: Served) -> Iterator[Any]:
    """Return the workbench's page, logged in at `served`; an error of its scripts fails the test."""
    with opened_page(browser, served) as page:
        yield page
