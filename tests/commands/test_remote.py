"""Commands on points at an address: the same results as with the local file, and nothing half written."""

from __future__ import annotations

import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import time

import pytest
from tests.scenes.laser_files import copc_file
from tests.scenes.remote_server import file_server

from linework.cli.app import main
from linework.files.remote import reader, requests
from linework.simulation.folder import write_survey_folder
from linework.simulation.simulate import simulate_survey

pytest.importorskip("obstore")
#: Many tiles, so that there is something to resume.
SETTINGS = "[tiling]\ncore_m = 64.0\nhigh_core_m = 64.0\nmax_points = 10000\n"
#: Keys and region that stand for the user's own.
KEYS = {"AWS_ACCESS_KEY_ID": "me", "AWS_SECRET_ACCESS_KEY": "geheim", "AWS_REGION": "eu-west-1"}


def sha(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    folder = tmp_path_factory.mktemp("remote") / "survey"
    write_survey_folder(simulate_survey("bends", 612, 150.0, points_per_m=800), folder)
    (folder / "run.toml").write_text(SETTINGS)
    return folder


@pytest.fixture(scope="module")
def server(survey):
    with file_server(survey / "points") as served:
        yield served


@pytest.fixture(scope="module")
def away(survey, server):
    """Return the same survey with its points at an address."""
    folder = survey.parent / "away" / "survey"
    folder.mkdir(parents=True)
    for path in survey.iterdir():
        if path.is_file():
            (folder / path.name).write_bytes(path.read_bytes())
    text = (survey / "survey.toml").read_text()
    text, n = re.subn(r'"points/(\w+\.laz)"', lambda name: f'"{server.address(name[1])}"', text)
    assert n == len(list((survey / "points").iterdir()))
    (folder / "survey.toml").write_text(text)
    return folder


@pytest.fixture(scope="module")
def lines(survey, tmp_path_factory):
    out = tmp_path_factory.mktemp("here")
    assert main(arguments(survey, out, "--workers", "1")) == 0
    return out / "lines.gpkg"


def arguments(survey, out, *more):
    return [
        "extract", str(survey), "-o", str(out / "lines.gpkg"),
        "--config", str(survey / "run.toml"), "--work", str(out / "work"), "--quiet", *more,
    ]  # fmt: skip


def test_lines_are_the_same_bytes(linework, away, server, lines, tmp_path):
    refused = linework(*arguments(away, tmp_path))
    assert refused.code == 2
    assert refused.stderr.count("\n") == 1
    assert "--allow-remote" in refused.stderr
    # With workers: they, too, are to find what was fetched
    done = linework(*arguments(away, tmp_path, "--allow-remote", "--workers", 2))
    assert done.code == 0, done.stderr
    assert sha(tmp_path / "lines.gpkg") == sha(lines)
    entries = [e for e in json.loads((tmp_path / "run.json").read_text())["inputs"] if "state" in e]
    assert entries
    for entry in entries:
        assert entry["file"].startswith("http://127.0.0.1:")
        assert entry["state"].endswith('bytes, "1"')
    assert not list(tmp_path.glob("work/**/fetched-*"))


def test_a_killed_run_goes_on_to_the_same_bytes(linework, away, lines, tmp_path):
    with subprocess.Popen(
        [sys.executable, "-m", "linework", *arguments(away, tmp_path, "--allow-remote")],
        start_new_session=True,
        stderr=subprocess.DEVNULL,
    ) as process:
        # Ends a hang, and is no measure of speed
        deadline = time.monotonic() + 600.0
        # Killed when tiles have been done
        while not list(tmp_path.glob("work/runs/*/tiles/*")) and process.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.005)
        os.killpg(process.pid, signal.SIGKILL)
    assert not (tmp_path / "lines.gpkg").exists()
    done = linework(*arguments(away, tmp_path, "--allow-remote", "--resume", "--workers", 1))
    assert done.code == 0, done.stderr
    assert sha(tmp_path / "lines.gpkg") == sha(lines)


def test_a_failing_server_leaves_no_output(linework, away, server, tmp_path, monkeypatch):
    monkeypatch.setattr(requests, "RETRIES", 1)
    reader._KEPT.clear()
    server.down_after = len(server.asked) + 3
    try:
        done = linework(
            "extract", away, "-o", tmp_path / "lines.gpkg", "--work", tmp_path / "work", "--allow-remote",
            "--quiet",
        )  # fmt: skip
    finally:
        server.down_after = None
    assert done.code == 5
    assert "the server failed (HTTP 503), also when asked again" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "lines.gpkg").exists()
    assert not list(tmp_path.glob("work/stores/*/*"))


def test_rasters_are_the_same_bytes(linework, tmp_path, monkeypatch):
    path = copc_file(tmp_path / "served" / "a.copc.laz", n=20_000, n_chunks=5)
    monkeypatch.chdir(tmp_path)
    with file_server(path.parent) as server:
        for name, where in (("here", path), ("far", server.address(path.name))):
            done = linework("raster", where, "-o", tmp_path / name, "--crs", "EPSG:25832", "--quiet")
            assert done.code == 0, done.stderr
    images = sorted(p.name for p in (tmp_path / "here").glob("*.tif"))
    assert images
    for name in images:
        assert sha(tmp_path / "here" / name) == sha(tmp_path / "far" / name), name
    record = json.loads((tmp_path / "far" / "run.json").read_text())
    assert record["inputs"][0]["file"] == server.address(path.name)


def test_info_reads_headers_only(linework, tmp_path, monkeypatch):
    path = copc_file(tmp_path / "served" / "a.copc.laz", n=60_000, n_chunks=50)
    monkeypatch.chdir(tmp_path)
    with file_server(path.parent) as server:
        told = linework("info", server.address(path.name), "--crs", "EPSG:25832", "--quiet")
        assert told.code == 0, told.stderr
        assert server.n_sent < 0.5 * path.stat().st_size
        document = linework("info", server.address(path.name), "--crs", "EPSG:25832", "--json", "--quiet")
    assert f"file        {server.address(path.name)}: LAS 1.4, point format 7, 60,000 points" in told.stdout
    assert "60,000 by the headers; no point was read" in told.stdout
    assert "intensity" not in told.stdout.split("columns")[0]
    found = json.loads(document.stdout)
    assert found["points"] == 60_000
    assert found["extent_m"] == {"west": 500_000, "south": 5_400_000, "east": 500_040, "north": 5_400_008}
    assert list(tmp_path.glob(".linework/stores/*")) == []


def test_object_storage_by_the_usual_environment(linework, tmp_path, monkeypatch):
    path = copc_file(tmp_path / "served" / "deep" / "a b.copc.laz", n=4000)
    monkeypatch.chdir(tmp_path)
    for name in [name for name in os.environ if name.startswith("AWS_")]:
        monkeypatch.delenv(name)
    with file_server(tmp_path / "served") as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{server.port}")
        # The bucket is the first folder of the request, as the fault is of the others
        done = linework("info", "s3://sound/deep/a b.copc.laz", "--crs", "EPSG:25832", "--quiet")
        assert done.code == 0, done.stderr
        assert f"s3://sound/deep/{path.name}: LAS 1.4" in done.stdout
        assert not any(server.signed)
        for name, value in KEYS.items():
            monkeypatch.setenv(name, value)
        assert linework("info", "s3://sound/deep/a b.copc.laz", "--crs", "EPSG:25832", "--quiet").code == 0
        assert server.signed[-1].startswith("AWS4-HMAC-SHA256 Credential=me/")
        assert "/eu-west-1/s3/" in server.signed[-1]
        refused = linework("info", "s3://forbidden/a.laz", "--quiet")
    assert refused.code == 3
    assert refused.stderr.startswith("error: s3://forbidden/a.laz: no access (HTTP 403).")
    assert refused.stderr.count("\n") == 1
    assert "geheim" not in refused.stderr


def test_copies_with_classes_are_those_of_the_local_files(linework, tmp_path, survey, away, lines, server):
    for source, out in ((survey, "here"), (away, "there")):
        done = linework(
            "classify", source, "--lines", lines, "-o", tmp_path / out, "--allow-remote", "--work", tmp_path / f"w-{out}",
            "--workers", "1", "--quiet",
        )  # fmt: skip
        assert done.code == 0, done.stderr
    here, there = ({p.name: sha(p) for p in (tmp_path / out).glob("*.laz")} for out in ("here", "there"))
    assert here == there and len(here) == len(list((survey / "points").iterdir()))
    # Nothing that was fetched stays, and the record names the addresses
    assert sorted(p.name for p in (tmp_path / "there").iterdir()) == sorted([*there, "classes.json"])
    record = json.loads((tmp_path / "there" / "classes.json").read_text())
    assert {file["file"] for file in record["files"]} == {server.address(name) for name in there}
