"""Several pages, many jobs, and workers that are busy: nothing is lost and the server answers (J19, J20, J24)."""

from __future__ import annotations

import os
import signal
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
from tests.workbench.serve_process import Served, wait_until


def clients(served: Served, n: int) -> list[httpx.Client]:
    name, value = served.cookie
    return [
        httpx.Client(base_url=served.url, headers={"Origin": served.url}, cookies={name: value}, timeout=60)
        for _ in range(n)
    ]


def test_one_of_those_who_edit_the_same_line_wins(served):
    """J19: all saw the same revision; the others are told 412, and theirs is not saved."""
    seen = served.get("/api/lines")
    line, revision = seen["lines"][0]["id"], seen["revision"]
    pages = clients(served, 6)

    def note(i: int) -> int:
        edit = {"action": "set", "ids": [line], "column": "note", "value": f"page {i}"}
        return pages[i].post("/api/changes", json={"revision": revision, "edit": edit}).status_code

    with ThreadPoolExecutor(len(pages)) as pool:
        statuses = list(pool.map(note, range(len(pages))))
    for page in pages:
        page.close()
    assert sorted(statuses) == [200, *[412] * 5]
    (now,) = [one for one in served.get("/api/lines")["lines"] if one["id"] == line]
    assert now["note"] == f"page {statuses.index(200)}"
    assert served.get("/api/survey")["revision"] == revision + 1


def test_a_stale_edit_is_told_what_to_do(served):
    seen = served.get("/api/lines")
    line = seen["lines"][1]["id"]
    edit = {"action": "accept", "ids": [line]}
    served.post("/api/changes", {"revision": seen["revision"], "edit": edit})
    again = {"action": "set", "ids": [line], "column": "note", "value": "late"}
    stale = served.client.post("/api/changes", json={"revision": seen["revision"], "edit": again})
    assert stale.status_code == 412
    assert line in stale.json()["problem"]
    assert "/" not in stale.json()["problem"]
    # A line that nobody else touched can be changed all the same
    other = {"action": "accept", "ids": [seen["lines"][2]["id"]]}
    served.post("/api/changes", {"revision": seen["revision"], "edit": other})


def test_a_thousand_jobs_are_one(served):
    """J20: one runs, all others are refused; to cancel it many times at once ends it once."""
    pages = clients(served, 8)
    order = {"features": ["cable"], "method": "radon"}
    with ThreadPoolExecutor(len(pages)) as pool:
        statuses = list(
            pool.map(lambda i: pages[i % 8].post("/api/jobs", json=order).status_code, range(1000))
        )
    # As a job may end meanwhile, another one may begin
    assert statuses.count(200) in range(1, 20)
    assert set(statuses) <= {200, 409, 429}
    running = [job for job in served.get("/api/jobs") if job["state"] == "running"]
    assert len(running) <= 1
    started = served.client.post("/api/jobs", json=order)
    assert started.status_code in (200, 409)
    last = served.get("/api/jobs")[-1]["id"]
    with ThreadPoolExecutor(len(pages)) as pool:
        ended = list(pool.map(lambda page: page.delete(f"/api/jobs/{last}"), pages))
    for page in pages:
        page.close()
    assert {answer.status_code for answer in ended} == {200}
    assert {answer.json()["state"] for answer in ended} <= {"cancelled", "done", "failed"}
    assert len({answer.json()["state"] for answer in ended}) == 1
    assert len(served.get("/api/jobs")) <= 20
    assert served.client.delete("/api/jobs/none").status_code == 404


def workers(served: Served) -> list[int]:
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(path.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        if parent == served.process.pid:
            found.append(int(path.parent.name))
    return found


def test_answers_while_all_workers_are_busy(served):
    """J24: the processes at work stand still with works waiting for them, and the server does not notice."""
    wait_until(lambda: served.get("/api/survey")["busy"] == "")
    line = served.get("/api/lines")["lines"][0]
    places = [vertex[:2] for vertex in line["xyz"][:1]]
    stopped = workers(served)
    assert len(stopped) >= 2
    waiting: list[int] = []

    def wait() -> None:
        (page,) = clients(served, 1)
        with page:
            order = {"kind": line["kind"], "places": places}
            waiting.append(page.post("/api/heights", json=order).status_code)

    for pid in stopped:
        os.kill(pid, signal.SIGSTOP)
    try:
        threads = [threading.Thread(target=wait) for _ in range(4)]
        for thread in threads:
            thread.start()
        for _ in range(60):
            assert served.client.get("/api/health").status_code == 200
        assert waiting == []
        # Lines can be judged meanwhile
        seen = served.get("/api/lines")
        edit = {"action": "accept", "ids": [seen["lines"][3]["id"]]}
        served.post("/api/changes", {"revision": seen["revision"], "edit": edit})
    finally:
        for pid in stopped:
            os.kill(pid, signal.SIGCONT)
        for thread in threads:
            thread.join()
    assert waiting == [200] * 4
