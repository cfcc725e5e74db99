"""Automatic extractions from the page: real runs on a small drive."""

import json
import os
import time
from pathlib import Path

import pytest
from tests.workbench.serve_process import LONGEST_WAIT_S, wait_until
from websockets.sync.client import connect

from linework.files.vectors.read_write import read_lines

BOUNDARY = {"features": ["road_boundary"], "method": "obb"}
WIRES = {"features": ["guardrail", "cable"], "method": "radon"}


def ended(served, name):
    """Return a job when it is over."""

    def job():
        return next(job for job in served.get("/api/jobs") if job["id"] == name)

    wait_until(lambda: job()["state"] != "running")
    return job()


def running():
    """Return the parent of each process that runs."""
    parents = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                state, parent = (entry / "stat").read_text().rpartition(")")[2].split()[:2]
            except OSError:
                continue
            if state != "Z":
                parents[int(entry.name)] = int(parent)
    return parents


def descendants(pid):
    """Return the numbers of all processes below one."""
    parents = running()
    found, new = set(), {pid}
    while new:
        new = {child for child, parent in parents.items() if parent in new}
        found |= new
    return found


def work_files(served):
    return sorted(path.name for path in (served.survey / ".linework" / "runs").iterdir())


def lines_by_review(served):
    return {line["id"]: line for line in served.get("/api/lines")["lines"]}


def edit(served, **document):
    revision = served.get("/api/lines")["revision"]
    return served.post("/api/changes", {"revision": revision, "edit": document})


@pytest.fixture(scope="module")
def done(served):
    """Run one job, of kinds that are not in the file yet; return what was told meanwhile, and the lines before."""
    before = lines_by_review(served)
    told = []
    headers = {"Cookie": served.cookie_header, "Origin": served.url}
    with connect(f"{served.socket_url}/api/live", additional_headers=headers) as socket:
        began = time.monotonic()
        job = served.post("/api/jobs", WIRES)
        while True:
            message = json.loads(socket.recv(timeout=LONGEST_WAIT_S))
            told.append((time.monotonic() - began, message))
            if message["type"] == "job" and message["state"] != "running":
                break
    return job, ended(served, job["id"]), told, before


def test_progress_is_told_to_all_pages(done):
    first, last, told, _ = done
    jobs = [message for _, message in told if message["type"] == "job"]
    assert first["state"] == "running"
    assert {job["id"] for job in jobs} == {first["id"]}
    assert {"find lines", "write report"} <= {job["step"] for job in jobs}
    assert all(job["done"] <= job["total"] for job in jobs)
    assert jobs[-1] == {"type": "job", **last}
    assert len(jobs) <= 5 * told[-1][0] + 10


def test_the_result_is_one_change(served, done):
    _, last, told, before = done
    assert last["state"] == "done"
    assert last["message"] == ""
    assert set(last["counts"]) == {"guardrail", "cable", "pole"}  # poles come with their wires
    (changed,) = [m for _, m in told if m["type"] == "changed" and m["action"] == "extract"]
    assert len(changed["lines"]) == sum(last["counts"].values()) > 0
    # Other kinds were not looked for
    now = lines_by_review(served)
    assert now == before | {line["id"]: line for line in changed["lines"]}


def test_the_result_can_be_undone_and_done_again(served, done):
    *_, before = done
    after = lines_by_review(served)
    assert served.post("/api/undo", {})["action"] == "undo"
    assert lines_by_review(served) == before
    served.post("/api/redo", {})
    assert lines_by_review(served) == after


def test_what_people_said_stays_when_it_is_found_again(served, done):
    *_, before = done
    new = sorted(lines_by_review(served).keys() - before.keys())
    edit(served, action="reject", ids=new[:1])
    edit(served, action="accept", ids=new[1:2])
    edit(served, action="delete", ids=new[2:3])
    said, revision = lines_by_review(served), served.get("/api/lines")["revision"]
    again = ended(served, served.post("/api/jobs", WIRES)["id"])
    assert again["state"] == "done"
    assert lines_by_review(served) == said
    assert served.get("/api/lines")["revision"] == revision  # nothing to undo where nothing is new


def test_the_report_can_do_nothing(served, done):
    _, last, *_ = done
    assert last["report"]
    answer = served.client.get(f"/api/jobs/{last['id']}/report")
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "sandbox" in policy.split("; ")
    assert "script" not in policy
    assert answer.headers["cache-control"] == "no-store"
    assert "<html" in answer.text
    assert "guardrail" in answer.text


def test_nothing_is_left_in_the_work_folder(served, done):
    assert work_files(served) == []
    assert done


@pytest.mark.parametrize(("order", "says"), [
    ({"features": ["road_boundary"], "method": "magic"}, "method"),
    ({"features": ["unicorn"], "method": "auto"}, "unknown kinds of line: unicorn"),
    ({"features": ["cable"], "method": "obb"}, "does not find cable"),
    ({"features": ["cable"] * 50}, "features"),
    ({"features": "cable"}, "features"),
    ({"output": "/etc/passwd"}, "output"),
])  # fmt: skip
def test_orders_that_make_no_sense(served, order, says):
    n_jobs = len(served.get("/api/jobs"))
    answer = served.client.post("/api/jobs", json=order)
    assert answer.status_code == 422
    assert says in answer.json()["problem"]
    assert "--" not in answer.json()["problem"]
    assert len(served.get("/api/jobs")) == n_jobs


def test_jobs_that_are_not_there(served):
    for name in ("0", "..", "%2e%2e", "x" * 30):
        assert served.client.get(f"/api/jobs/{name}/report").status_code == 404
        assert served.client.delete(f"/api/jobs/{name}").status_code in (404, 405)


def started_and_cancelled(served, wait_s):
    """Start a job, try to start others beside it, cancel it after a while; return it and the answer."""
    job = served.post("/api/jobs", {"method": "auto"})
    for _ in range(40):
        answer = served.client.post("/api/jobs", json=BOUNDARY)
        assert answer.status_code == 409
        assert answer.json()["problem"].startswith("an extraction is running")
    time.sleep(wait_s)
    return job, served.client.delete(f"/api/jobs/{job['id']}").json()


def test_one_at_a_time_and_cancelled_at_once(served):
    """J20: many starts, one run; cancelled with all its processes, nothing half-written, and again and again."""
    before, at_rest = lines_by_review(served), descendants(served.process.pid)
    for wait_s in (0.0, 0.5, 3.0):
        job, cancelled = started_and_cancelled(served, wait_s)
        while cancelled["state"] == "done" and wait_s > 0.0:  # a quick machine was done before
            assert served.post("/api/undo", {})["action"] == "undo"
            wait_s /= 2.0
            job, cancelled = started_and_cancelled(served, wait_s)
        assert cancelled["state"] == "cancelled"
        assert served.client.delete(f"/api/jobs/{job['id']}").json() == cancelled
        assert served.client.get(f"/api/jobs/{job['id']}/report").status_code == 404
        wait_until(lambda: descendants(served.process.pid) <= at_rest)
    assert lines_by_review(served) == before
    assert len(read_lines(served.lines)) == sum(line["review"] != "rejected" for line in before.values())


def test_a_job_that_fails_says_why_and_the_next_one_runs(served):
    """Its process is killed from outside: one line, nothing changed, and the same order ends well afterwards."""
    before, at_rest = lines_by_review(served), descendants(served.process.pid)
    of_others = work_files(served)  # a cancelled run can be gone on with
    job = served.post("/api/jobs", BOUNDARY)
    while not (new := descendants(served.process.pid) - at_rest):
        time.sleep(0.01)
    time.sleep(1.0)
    os.kill(min(new), 9)
    failed = ended(served, job["id"])
    assert failed["state"] == "failed"
    assert "died" in failed["message"]
    assert "\n" not in failed["message"]
    assert lines_by_review(served).keys() == before.keys()
    again = ended(served, served.post("/api/jobs", BOUNDARY)["id"])
    assert again["state"] == "done"
    assert work_files(served) == of_others


def test_a_job_dies_with_its_server(served_alone):
    served_alone.post("/api/jobs", {"method": "auto"})
    time.sleep(1.0)
    below = descendants(served_alone.process.pid)
    assert below
    served_alone.stop(9)
    wait_until(lambda: not below & running().keys())
