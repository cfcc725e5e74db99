"""The command `linework serve` as a user runs it: what it prints, how it ends, what it refuses."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from tests.conftest import road_points
from tests.workbench.serve_process import Served, served_survey, wait_until

from linework.cli.commands.serve import serve
from linework.files.las.write import write_las
from linework.files.vectors.read_write import read_lines
from linework.library.progress import open_display
from linework.workbench.server.serve import RunningServer, run_server
from linework.workbench.worker.conversation import start_worker_process
from linework.workbench.worker.order import SurveyOrder


def children(pid: int) -> list[int]:
    return [int(path.parent.name) for path in Path("/proc").glob("[0-9]*/stat") if parent_of(path) == pid]


def parent_of(stat: Path) -> int:
    try:
        return int(stat.read_text().rpartition(")")[2].split()[1])
    except OSError:
        return -1


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_serves_the_survey(served):
    survey = served.get("/api/survey")
    assert survey["n_points"] > 10_000
    assert survey["n_pairs"] == 7
    assert survey["lines_file"] == "lines.gpkg"
    assert survey["who"]
    assert len(survey["path"]) > 10
    images = {image["name"]: image["classes"] for image in survey["images"]}
    assert set(images) == {"density", "height", "above_road", "intensity", "class", "road"}
    assert [name for name, classes in images.items() if classes] == ["class"]
    assert survey["tiles"]["resolutions"] == sorted(survey["tiles"]["resolutions"], reverse=True)
    kinds = {kind["kind"]: kind for kind in survey["kinds"]}
    assert kinds["road_boundary"]["colour"] == "#d55e00"
    assert kinds["guardrail"]["picked"]
    assert not kinds["guardrail"]["picked_in_images"]
    lines = served.get("/api/lines")
    assert {line["kind"] for line in lines["lines"]} >= {"lane_marking", "road_boundary"}


def test_what_came_and_went_since_a_revision(served):
    before = served.get("/api/lines")
    first, second = (line["id"] for line in before["lines"][:2])
    revision = before["revision"]
    assert served.get(f"/api/lines?since={revision}")["lines"] == (before["lines"] if revision == 0 else [])
    accepted = served.post(
        "/api/changes", {"revision": revision, "edit": {"action": "accept", "ids": [first]}}
    )
    deleted = served.post(
        "/api/changes", {"revision": accepted["revision"], "edit": {"action": "delete", "ids": [second]}}
    )
    news = served.get(f"/api/lines?since={accepted['revision'] - 1 or 1}")
    assert news["revision"] == deleted["revision"]
    assert second in news["removed"]
    assert served.get(f"/api/lines?since={deleted['revision']}") == {
        "revision": deleted["revision"], "lines": [], "removed": [], "can_undo": True, "can_redo": False
    }  # fmt: skip
    # A page of another run, which knows of more than there is, gets everything
    whole = served.get("/api/lines?since=999999")
    assert len(whole["lines"]) == len(before["lines"]) - 1


def test_ready_in_the_end(served):
    wait_until(lambda: served.get("/api/survey")["busy"] == "")


def test_a_second_one_on_the_same_lines(served):
    said = refused(served.survey)
    assert said.returncode == 6
    assert "lines.gpkg" in said.stderr


def refused(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run a server that does not come up, and see that it says so in one line."""
    said = subprocess.run(
        [sys.executable, "-m", "linework", "serve", *map(str, arguments), "--no-browser", "--quiet"],
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert said.stdout == ""
    (line,) = said.stderr.splitlines()
    assert line.startswith("error: ")
    return said


def test_a_port_that_is_taken(served):
    said = refused(served.survey, "--lines", served.survey.parent / "other.gpkg", "--port", served.port)
    assert said.returncode == 5
    assert f"--port {served.port}: the port is taken" in said.stderr
    assert not (served.survey.parent / "other.gpkg").exists()


def test_what_cannot_be_served(served, tmp_path):
    not_a_package = tmp_path / "text.gpkg"
    not_a_package.write_text("no lines here")
    said = refused(served.survey, "--lines", not_a_package)
    assert said.returncode == 3
    assert "text.gpkg" in said.stderr
    assert not_a_package.read_text() == "no lines here"
    assert refused(served.survey, "--lines", tmp_path / "lines.dxf").returncode == 2
    assert refused(tmp_path / "nothing").returncode == 3


def test_hostile_files_are_refused_before_anything_is_served(tmp_path):
    """J16: there is no upload; what the command names is checked as by all other commands."""
    for name, content in (("page.laz", b"<!doctype html><title>Not found</title>"), ("empty.las", b""),
                          ("zip.laz", b"PK\x03\x04" + bytes(400)), ("cut.laz", b"LASF" + bytes(300))):  # fmt: skip
        (tmp_path / name).write_bytes(content)
        said = refused(tmp_path / name)
        assert said.returncode == 3
        assert said.stderr.count("\n") == 1 and name in said.stderr
    (tmp_path / "survey.toml").write_text('[points]\nfiles = ["/etc/*"]\n')
    assert "is outside the folder" in refused(tmp_path).stderr


def test_another_trajectory(made_drive, made_lines, tmp_path):
    survey = tmp_path / "drive"
    shutil.copytree(made_drive, survey)
    header, *rows = (survey / "trajectory.csv").read_text().splitlines()
    east = header.split(",").index("easting_m")
    moved = [",".join(str(float(cell) + 5.0) if i == east else cell for i, cell in enumerate(row.split(",")))
             for row in rows]  # fmt: skip
    (tmp_path / "moved.csv").write_text("\n".join([header, *moved]))
    assert "absent.csv" in refused(survey, "--trajectory", tmp_path / "absent.csv").stderr
    paths = []
    for more in ((), ("--trajectory", tmp_path / "moved.csv")):
        with served_survey(survey, *more) as served:
            paths.append(served.get("/api/survey")["path"][0][0])
    assert paths[1] - paths[0] == pytest.approx(5.0, abs=0.2)


def test_lines_of_another_crs(tmp_path, made_lines):
    survey = tmp_path / "a.laz"
    write_las(road_points(), survey, crs="EPSG:25833+7837")
    said = refused(survey, "--lines", made_lines)
    assert said.returncode == 3
    assert "25833" in said.stderr or "zone 33" in said.stderr


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_ends_when_it_is_told_to(served_alone, number, code):
    served: Served = served_alone
    wait_until(lambda: served.get("/api/survey")["busy"] == "")
    line = served.get("/api/lines")["lines"][0]["id"]
    served.post("/api/changes", {"revision": 0, "edit": {"action": "accept", "ids": [line]}})
    at_work = children(served.process.pid)
    assert len(at_work) >= 2
    assert served.stop(number) == code
    wait_until(lambda: not any(is_running(pid) for pid in at_work))
    wait_until(lambda: served.stderr[-1] == "stopped: all changes are saved\n")
    left = {path.name for path in served.survey.iterdir() if path.name.startswith(("lines", ".lines"))}
    assert left == {"lines.gpkg"}
    lines = read_lines(served.lines)
    assert "accepted" in lines.review.tolist()


def test_ends_while_it_opens(made_drive, tmp_path):
    work = tmp_path / "work"
    process = subprocess.Popen(
        [sys.executable, "-m", "linework", "serve", made_drive, "--lines", tmp_path / "a.gpkg", "--work", work,
         "--no-browser"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    wait_until(lambda: len(children(process.pid)) >= 1)
    at_work = children(process.pid)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 130
    assert out == ""
    assert err.splitlines()[-1].startswith(("stopped", "interrupted"))
    wait_until(lambda: not any(is_running(pid) for pid in at_work))


def test_a_process_that_was_started_ends_whatever_fails_before_it_is_used(made_drive, monkeypatch):
    """Signals cannot be handled in a thread other than the first: the server fails before it opens anything."""
    process = start_worker_process()
    order = SurveyOrder((made_drive,))
    with open_display(quiet=True) as display:
        serving = RunningServer(
            order=order, lines=None, process=process, port=0, who="", watcher=display, ready=print, renewed=print,
            save_log=print,
        )  # fmt: skip
        with (
            ThreadPoolExecutor(1) as pool,
            pytest.raises(ValueError, match="signal only works in main thread"),
        ):
            pool.submit(asyncio.run, run_server(serving)).result()
    assert not is_running(process.pid)
    # Nor is there a moment between the command, which starts it, and the server
    process = start_worker_process()
    monkeypatch.setattr("linework.workbench.worker.conversation.start_worker_process", lambda: process)
    monkeypatch.setattr("linework.runs.compile.compile_stage", lambda *_: None)
    monkeypatch.setattr(asyncio, "run", cannot_run)
    try:
        with pytest.raises(OSError, match="too many open files"):
            serve([made_drive], no_browser=True, quiet=True)
        assert not is_running(process.pid)
    finally:
        process.end()


def cannot_run(coroutine):
    coroutine.close()
    raise OSError("too many open files")


def test_killed_it_leaves_no_process(served_alone):
    served: Served = served_alone
    wait_until(lambda: len(children(served.process.pid)) >= 2)
    at_work = children(served.process.pid)
    served.process.kill()
    wait_until(lambda: not any(is_running(pid) for pid in at_work))
    # What it held is free, and the link is of the past
    with served_survey(served.survey) as again:
        assert again.get("/api/health") == {"well": True}
        assert again.cookie != served.cookie


def test_json_and_another_file(made_drive, tmp_path):
    lines = tmp_path / "sub" / "drawn.gpkg"
    lines.parent.mkdir()
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    process = subprocess.Popen(
        [sys.executable, "-m", "linework", "serve", made_drive, "--lines", lines, "--port", str(port), "--json",
         "--no-browser", "--who", "Ada", "--quiet"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )  # fmt: skip
    said = json.loads(process.stdout.readline())
    process.terminate()
    out, _ = process.communicate(timeout=300)
    assert (process.returncode, out) == (143, "")
    assert said["url"].startswith(f"http://127.0.0.1:{port}/?token=")
    assert (said["lines"], said["who"]) == (str(lines), "Ada")
    # A drawing with nothing in it yet is a file that can be read
    assert len(read_lines(lines)) == 0


def test_page(page):
    """The built page, or the word that there is none, is served to a browser that is logged in."""
    assert "linework" in page.title().lower()


def test_the_report_by_chainage_has_no_scripts_and_refuses_what_it_has_not(served):
    answer = served.client.get("/api/chainage?every_m=20&standard=us")
    assert answer.status_code == 200
    assert "sandbox" in answer.headers["content-security-policy"]
    assert "<script" not in answer.text and "lane width" in answer.text
    for wrong in ("every_m=0", "every_m=nan", "standard=xx"):
        assert served.client.get(f"/api/chainage?{wrong}").status_code == 422
