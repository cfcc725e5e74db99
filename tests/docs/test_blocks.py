"""Every code block of README, CONTRIBUTING and docs runs, each page in a folder of its own."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from tests.docs.blocks import ROOT, blocks, fences, indented

from linework.cli.app import main
from linework.files.vectors.read_write import read_lines, write_lines

PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("page/*.md"), *(ROOT / "docs").rglob("*.md")])
#: Pages that Sphinx writes: their sources are there only after `make docs`.
PAGES = [page for page in PAGES if "generated" not in page.parts and "gallery" not in page.parts]
WITH_BLOCKS = [page for page in PAGES if fences(page.read_text(encoding="utf-8"))]
#: What a user has in the working directory: what most pages speak of, and pages that speak of something else.
USUAL = ("survey", "points", "trajectory.csv")
GIVEN = {
    "python.md": (*USUAL, "lines.gpkg"),
    "evaluation.md": ("lines.gpkg", "map.geojson"),
    "navigation.md": ("survey",),
    "simulation.md": (),
}
#: Names of a published map for our kinds, as docs/evaluation.md has them.
MARKS = {"lane_marking": "SOLID_WHITE", "road_boundary": "drivable_area_edge"}


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """A survey of 40 m with points, a stereo pair, logs and ground truth, and the files that pages name."""
    folder = tmp_path_factory.mktemp("given")
    simulated = (
        "--road", "urban", "--seed", "3", "--length-m", "40", "--points-per-m", "1500", "--image-every-m", "20",
        "--image-size", "732x484",
    )  # fmt: skip
    assert main(["simulate", "-o", str(folder / "survey"), *simulated, "--quiet"]) == 0
    shutil.copytree(folder / "survey" / "points", folder / "points")
    shutil.copy(folder / "survey" / "trajectory.csv", folder)
    truth = replace(read_lines(folder / "survey" / "truth.gpkg"), crs="local")
    write_lines(truth, folder / "lines.gpkg")
    write_lines(truth, folder / "map.geojson")
    document = json.loads((folder / "map.geojson").read_text(encoding="utf-8"))
    for line in document["features"]:
        line["properties"] = {"mark": MARKS.get(line["properties"].get("kind"), "OTHER")}
    (folder / "map.geojson").write_text(json.dumps(document), encoding="utf-8")
    return folder


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A fresh working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", WITH_BLOCKS, ids=name)
def test_blocks_run(page, given, here):
    for file in GIVEN.get(page.name, USUAL):
        (shutil.copytree if (given / file).is_dir() else shutil.copy)(given / file, here / file)
    for block in blocks(page):
        block.evaluate()


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_block_is_taken_by_an_evaluator(page):
    text = page.read_text(encoding="utf-8")
    assert not indented(text), "blocks are fenced, with a language"
    starts = {block.line for block in blocks(page)}
    assert len(starts) == len(fences(text)), fences(text)


@pytest.mark.parametrize(
    "block",
    [
        "```sh\nlinework nonsense\n```",
        "```sh\nlinework info absent.laz\nlinework --help\n```",
        "```sh\nmake nonsense\n```",
        "```sh\npip install '.[nonsense]'\n```",
        "```sh\npip install nonsense\n```",
        "```sh\nlinework serve absent\n```",
        "```python\nimport linework\nlinework.nonsense\n```",
        '```toml\n[trajectory]\nfiel = "a.csv"\n```',
        "```toml\n[obb.marking]\nnonsense = 1\n```",
        "```text\nlinework info points\n```",
    ],
)
def test_a_wrong_block_fails(block, here):
    page = here / "page.md"
    page.write_text(f"# Page\n\n{block}\n", encoding="utf-8")
    (example,) = blocks(page)
    with pytest.raises(BaseException):  # noqa: B017 - each block fails its own way
        example.evaluate()


def test_languages_without_an_evaluator_are_noticed(here):
    page = here / "page.md"
    page.write_text("# Page\n\n```bash\nls\n```\n\n    indented\n", encoding="utf-8")
    assert fences(page.read_text(encoding="utf-8")) == ["bash"]
    assert indented(page.read_text(encoding="utf-8")) == [7]
    assert blocks(page) == []
