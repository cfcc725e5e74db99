"""The check of stereo pairs is kept in the work folder while images, cameras and times stay the same."""

from __future__ import annotations

from pathlib import Path

import cv2
import pytest
from tests.scenes.road_views import views_folder

from linework.files.survey.open import open_survey
from linework.runs.opened import pairs
from linework.runs.opened.made import is_listed, remove_made
from linework.runs.opened.recordings import opened_recordings
from linework.runs.opened.work_folder import work_folder


@pytest.fixture
def checks(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Number of each check that is made."""
    made: list[int] = []
    check = pairs.check_pairs
    monkeypatch.setattr(pairs, "check_pairs", lambda *a, **k: (made.append(len(made)), check(*a, **k))[1])
    return made


def opened(root: Path, work: Path) -> tuple[str, ...]:
    """Open the survey anew; return its usable pairs and warnings as text."""
    with opened_recordings(open_survey([root]), work) as recordings:
        assert recordings.stereo is not None
        assert recordings.stereo.series.rig is not None
        return (*(str(pair.number) for pair in recordings.stereo.pairs), *recordings.stereo.warnings)


def test_pairs_are_checked_once_and_again_when_an_image_is_another(tmp_path: Path, checks: list[int]) -> None:
    root = views_folder(tmp_path / "views")
    work = work_folder(root, tmp_path / "work")
    first = opened(root, work)
    assert len(checks) == 1
    assert opened(root, work) == first and len(checks) == 1
    (kept,) = (work / "stores").glob("pairs-*.json")
    kept.write_text("{")
    assert opened(root, work) == first and len(checks) == 2
    # The middle pairs are looked at; any change of a byte counts
    for image in sorted(root.rglob("*.png"))[3:5]:
        grey = read_image_grey(image)
        cv2.imwrite(str(image), 255 - grey)
    opened(root, work)
    assert len(checks) == 3
    assert is_listed(work)
    for path in (work / "stores").glob("pairs-*.json"):
        assert remove_made(work, f"stores/{path.name}")[0] > 0


def read_image_grey(path: Path):
    """Return the pixels of an image."""
    return cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)


def test_where_nothing_can_be_kept_the_check_is_made_each_time(
    tmp_path: Path, checks: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    root = views_folder(tmp_path / "views")
    work = work_folder(root, tmp_path / "work")

    def refuse(*_: object, **__: object) -> None:
        raise pairs.MachineError("read-only")

    monkeypatch.setattr(pairs, "write_bytes", refuse)
    assert opened(root, work) == opened(root, work)
    assert len(checks) == 2


def test_hashes_of_images_are_made_when_they_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = views_folder(tmp_path / "views")
    hashed: list[Path] = []
    monkeypatch.setattr(pairs.OpenedStereo, "hashes", lambda self: (hashed.append(root), {root: "x"})[1])
    with opened_recordings(open_survey([root]), tmp_path / "work") as recordings:
        assert hashed == []
        assert recordings.hashes[root] == "x" and len(recordings.hashes) >= 1
        assert hashed == [root]
