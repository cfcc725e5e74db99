"""Little memory, few files, few processes, absurd settings, and the worst input there is: an answer, or one line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.conftest import CRS

from linework.files.las.write import write_las
from linework.model.points import Points

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits as the kernel of Linux has them")
COMMAND = (sys.executable, "-m", "linework")


def limited(limit: str, *arguments: object, timeout_s: float = 300.0) -> subprocess.CompletedProcess[str]:
    """Run `linework` under a limit of the shell's ulimit."""
    words = ["sh", "-c", f'ulimit {limit} && exec "$@"', "sh", *COMMAND, *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, check=False, timeout=timeout_s)


def is_one_line(said: subprocess.CompletedProcess[str]) -> bool:
    errors = [line for line in said.stderr.splitlines() if line.startswith("error:")]
    return len(errors) == 1 and "Traceback" not in said.stderr and len(errors[0]) <= 500


@pytest.mark.parametrize("gib", [1, 2, 4])
def test_little_address_space_is_enough_or_is_said(las_file, tmp_path, gib):
    limit = f"-v {int(gib * (1 << 20))}"
    said = limited(limit, "extract", las_file, "-o", tmp_path / "a.gpkg", "--quiet", "--workers", "1")
    assert said.returncode in (0, 5), said.stderr
    assert (tmp_path / "a.gpkg").exists() == (said.returncode == 0)
    if said.returncode == 5:
        assert is_one_line(said), said.stderr
        assert "memory" in said.stderr
    if gib == 4:
        assert said.returncode == 0, said.stderr


@pytest.mark.parametrize("limit", ["-n 5", "-n 10", "-n 16", "-n 24", "-n 64"])
def test_few_open_files_are_enough_or_are_said(las_file, tmp_path, limit):
    said = limited(limit, "extract", las_file, "-o", tmp_path / "a.gpkg", "--quiet", "--workers", "2")
    # Below some ten files not even Python's own modules can be imported
    if limit == "-n 5":
        assert said.returncode != 0
        assert not (tmp_path / "a.gpkg").exists()
        return
    assert said.returncode in (0, 5), said.stderr
    assert (tmp_path / "a.gpkg").exists() == (said.returncode == 0)
    if said.returncode == 5:
        assert is_one_line(said), said.stderr
        assert "ulimit -n" in said.stderr or "open files" in said.stderr
    if limit == "-n 64":
        assert said.returncode == 0, said.stderr


def test_a_worker_that_may_not_be_started_is_said(las_file, tmp_path):
    """The limit on processes does not hold for root: the call that starts one is made to fail."""
    code = (
        "import errno, os, subprocess, sys; from linework.cli.app import main\n"
        "def no_more(*_, **__): raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))\n"
        "subprocess.Popen = no_more\n"
        f"sys.exit(main(['extract', {str(las_file)!r}, '-o', {str(tmp_path / 'a.gpkg')!r}, '--quiet']))"
    )
    said = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=300
    )
    assert said.returncode == 5, said.stderr
    assert is_one_line(said)
    assert "ulimit -u" in said.stderr
    assert not (tmp_path / "a.gpkg").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ("extract", "SURVEY", "-o", "OUT.gpkg", "--workers", "1000000"),
        ("raster", "SURVEY", "-o", "OUT", "--cell-m", "1e-9"),
        ("raster", "SURVEY", "-o", "OUT", "--cell-m", "0.001"),
        ("raster", "SURVEY", "-o", "OUT", "--cell-along-m", "1e-9"),
        ("raster", "SURVEY", "-o", "OUT", "--cell-across-m", "1e-12"),
        ("raster", "SURVEY", "-o", "OUT", "--cell-m", "nan"),
        ("simulate", "-o", "OUT", "--length-m", "1e9"),
        ("simulate", "-o", "OUT", "--points-per-m", "1e12"),
        ("simulate", "-o", "OUT", "--seed", "-1"),
        ("photolog", "SURVEY", "-o", "OUT.html", "--every-m", "1e-9"),
        ("evaluate", "SURVEY", "SURVEY", "--tolerance-m", "1e12"),
    ],
    ids=lambda words: " ".join(words[:1] + words[-2:]),
)
def test_settings_of_absurd_cost_are_refused_at_once(linework, tmp_path, arguments):
    rng = np.random.default_rng(1)
    xyz = rng.uniform([500_000, 5_400_000, 100], [500_900, 5_400_900, 101], (500, 3))
    write_las(Points(xyz, time_s=np.linspace(3e8, 3e8 + 1, 500)), tmp_path / "s" / "a.laz", crs=CRS)
    words = [
        word.replace("SURVEY", str(tmp_path / "s")).replace("OUT", str(tmp_path / "out"))
        for word in arguments
    ]
    found = linework(*words)
    # A survey that is too large for the setting is refused as an input
    assert found.code in (2, 3, 5), found
    assert len(found.line.replace(str(tmp_path), "")) <= 300
    assert not list(tmp_path.glob("out*"))


@pytest.mark.parametrize(
    "text",
    [
        "[tiling]\ncore_m = 1e9", "[tiling]\ncore_m = 1e-9", "[tiling]\nmax_points = 0",
        "[tiling]\nleast_core_m = 1e-12", "[tiling]\ncore_m = nan", "[tiling]\nmax_points = 99999999999999999999",
    ],
)  # fmt: skip
def test_run_files_of_absurd_cost_are_refused(linework, las_file, tmp_path, text):
    (tmp_path / "run.toml").write_text(text)
    found = linework("extract", las_file, "-o", tmp_path / "a.gpkg", "--config", tmp_path / "run.toml")
    assert found.code == 2
    assert "tiling." in found.line and "expected" in found.line


def worst(name: str) -> Points:
    """Return points that make most candidates, of which every pair could belong together."""
    side, n = 24.0, 200_000
    rng = np.random.default_rng(5)
    xyz = np.column_stack([rng.uniform(0, side, (n, 2)), rng.normal(0.0, 0.005, n)])
    if name == "checkerboard":
        bright = (np.floor(xyz[:, 0] / 0.3) + np.floor(xyz[:, 1] / 0.3)) % 2 == 0
    elif name == "all bright":
        bright = np.ones(n, bool)
    elif name == "stripes":
        bright = np.floor(xyz[:, 1] / 0.15) % 2 == 0
    else:  # posts in a grid as high as guardrails
        bright = np.zeros(n, bool)
        post = (np.abs(xyz[:, 0] % 1.0 - 0.5) < 0.06) & (np.abs(xyz[:, 1] % 1.0 - 0.5) < 0.06)
        xyz[post, 2] = rng.uniform(0.0, 0.9, int(post.sum()))
    intensity = np.where(bright, 3500.0, 300.0) + rng.normal(0.0, 60.0, n)
    return Points(
        xyz + np.array([500_000.0, 5_400_000.0, 100.0]), intensity=intensity.clip(1, 65_000).astype(np.float32),
        time_s=np.linspace(3e8, 3e8 + 10, n),
    )  # fmt: skip


@pytest.mark.parametrize("name", ["checkerboard", "all bright", "stripes", "posts"])
def test_the_worst_input_ends(linework, tmp_path, name):
    write_las(worst(name), tmp_path / "s" / "a.laz", crs=CRS)
    output: Path = tmp_path / "a.gpkg"
    found = linework("extract", tmp_path / "s", "-o", output, "--quiet", "--workers", "1")
    assert found.code == 0, found.stderr
    assert output.exists()
