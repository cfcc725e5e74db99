"""Who may ask the workbench: token, cookie, Host, Origin (J01 to J06, J12, J13, J18, J23)."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import httpx
import pytest
from tests.workbench.safety.raw_http import SOCKETS, exchange, handshake, request, routes
from tests.workbench.serve_process import Served, wait_until

from linework.workbench.server.guard import REPORT_POLICY
from linework.workbench.server.sessions import MOST_SESSIONS, Sessions

NO_SESSION = {"problem": "no session: open the link that linework printed", "status": 401}


def test_no_route_answers_without_a_session(served):
    """J01: all routes, all places where a token could be put; the same words every time."""
    token = "x" * 43
    tries = {
        "nothing": {},
        "a wrong cookie": {"Cookie": f"{served.cookie[0]}={token}"},
        "an empty cookie": {"Cookie": f"{served.cookie[0]}="},
        "the right value under another name": {"Cookie": f"linework={served.cookie[1]}"},
        "the session in a header": {"Authorization": f"Bearer {served.cookie[1]}"},
        "a cookie of no name": {"Cookie": served.cookie[1]},
        "not ASCII": {"Cookie": f"{served.cookie[0]}=\u00e4\u00f6"},
    }
    asked = routes(served)
    assert len(asked) > 15
    bodies = set()
    with httpx.Client(base_url=served.url, headers={"Origin": served.url}) as stranger:
        for method, path in [*asked, ("GET", "/api/nothing"), ("GET", "/nothing"), ("POST", "/")]:
            for what, headers in tries.items():
                encoded = {name: value.encode() for name, value in headers.items()}
                answer = stranger.request(method, path, headers=encoded)
                assert answer.status_code == 401, f"{method} {path} with {what}"
                bodies.add(answer.content)
            query = stranger.request(method, f"{path}?token={served.cookie[1]}")
            assert query.status_code in (401, 403), path
    (body,) = bodies
    assert httpx.Response(401, content=body).json() == NO_SESSION


def test_every_wrong_value_takes_the_same_way(monkeypatch):
    """J01: compared by `compare_digest`, with every session, whether or not one was right already."""
    import hmac

    compared = []
    real = hmac.compare_digest
    monkeypatch.setattr(hmac, "compare_digest", lambda a, b: compared.append((a, b)) or real(a, b))
    sessions = Sessions(1)
    cookies = [sessions.enter(sessions.token) for _ in range(3)]
    for value, is_known in ((cookies[0], True), (cookies[2], True), ("", False), ("x", False)):
        compared.clear()
        assert sessions.knows(f"a=b; {sessions.cookie_name}={value}; c=d") is is_known
        assert len(compared) == 3


def test_a_token_opens_one_session():
    sessions = Sessions(1)
    token = sessions.token
    assert sessions.enter("") == ""
    assert sessions.enter(token[:-1]) == ""
    assert sessions.enter(token)
    assert sessions.enter(token) == ""
    assert sessions.token != token
    assert len(token) >= 43  # 32 bytes


def test_sessions_are_bounded():
    sessions = Sessions(1)
    cookies = [sessions.enter(sessions.token) for _ in range(MOST_SESSIONS + 1)]
    assert not sessions.knows(f"{sessions.cookie_name}={cookies[0]}")
    assert all(sessions.knows(f"{sessions.cookie_name}={cookie}") for cookie in cookies[1:])


def test_the_link_is_used_up_and_the_next_one_printed(served_alone):
    served: Served = served_alone
    with httpx.Client(base_url=served.url) as another:
        used = another.get(served.links[0])
        wrong = another.get("/?token=abc")
        assert used.status_code == wrong.status_code == 403
        assert used.content == wrong.content
        assert "set-cookie" not in used.headers
        assert another.get("/api/survey").status_code == 401
        wait_until(lambda: any("for another browser: " in line for line in served.stderr))
        (line,) = [line for line in served.stderr if "for another browser: " in line]
        entered = another.get(line.split("for another browser: ")[1].strip())
        assert entered.status_code == 303
        # J12: the cookie is for this page alone
        name, *attributes = (part.strip() for part in entered.headers["set-cookie"].split(";"))
        assert name.startswith(f"linework-{served.port}=")
        assert {a.lower() for a in attributes} == {"httponly", "path=/", "samesite=strict"}
        assert another.get("/api/survey").status_code == 200
    # The one that was there first still is
    assert served.client.get("/api/survey").status_code == 200
    # A used link in a browser that is in already leads to the page
    assert served.client.get(served.links[0]).headers["location"] == "/"


def foreign_hosts(port: int) -> list[tuple[str, ...]]:
    return [
        ("Host: evil.example",),
        (f"Host: evil.example:{port}",),
        (f"Host: 127.0.0.1.evil:{port}",),
        (f"Host: 127.0.0.1:{port}.evil.example",),
        ("Host:",),
        (),
        (f"Host: 127.0.0.1:{port}", "Host: evil.example"),
        (f"Host: 127.0.0.1:{port}", f"Host: 127.0.0.1:{port}"),
        (f"Host: [::1]:{port}",),
        (f"Host: 127.0.0.1.:{port}",),
        (f"Host: localhost.:{port}",),
        ("Host: 127.0.0.1",),
        (f"Host: 127.0.0.1:{port + 1}",),
        (f"Host: 127.0.0.1:{port}@evil.example",),
        (f"Host: 0.0.0.0:{port}",),
        (f"Host: 2130706433:{port}",),
        (f"Host: 127.0.0.1:0{port}",),
        (f"Host: evil.example\tHost: 127.0.0.1:{port}",),
    ]


def test_only_its_own_name_is_answered(served):
    """J02: rebound names, on every route and the page itself, with a good session."""
    session = (f"Cookie: {served.cookie_header}", f"Origin: {served.url}")
    for method, path in [*routes(served), ("GET", "/"), ("GET", "/?token=abc")]:
        for hosts in foreign_hosts(served.port):
            answer = exchange(served.port, request(method, path, *hosts, *session))
            assert answer is not None, (path, hosts)
            assert answer.status in (400, 403), (method, path, hosts, answer)
            assert "n_points" not in answer.body
    for name in ("127.0.0.1", "localhost"):
        own = exchange(
            served.port, request("GET", "/api/survey", f"Host: {name}:{served.port}", *session[:1])
        )
        assert own.status == 200


def test_old_http_without_a_host_is_refused(served):
    answer = exchange(
        served.port, request("GET", "/api/survey", f"Cookie: {served.cookie_header}", version="1.0")
    )
    assert answer.status == 403


@pytest.mark.parametrize("target", ["http://evil.example/api/survey", "//evil.example/api/survey"])
def test_absolute_targets_are_no_way_in(served, target):
    answer = exchange(served.port, request("GET", target, f"Host: {served.host}"))
    assert answer.status in (400, 401, 403, 404)


FOREIGN_ORIGINS = (
    ("Origin: http://evil.example",),
    ("Origin: null",),
    (),
    ("Origin:",),
    ("Origin: http://127.0.0.1",),
    ("Origin: http://127.0.0.1:1",),
)


def test_other_sites_change_nothing(served):
    """J03: with the session's cookie, as a browser would send it from another port of this machine."""
    revision = served.get("/api/survey")["revision"]
    for method, path in routes(served):
        if method == "GET":
            continue
        for origin in (*FOREIGN_ORIGINS, (f"Origin: {served.url}", "Origin: http://evil.example")):
            for content_type in ("text/plain", "application/json"):
                answer = exchange(
                    served.port,
                    request(
                        method, path, f"Host: {served.host}", f"Cookie: {served.cookie_header}", *origin,
                        f"Content-Type: {content_type}", body=b"{}",
                    ),
                )  # fmt: skip
                assert answer.status == 403, (method, path, origin)
    assert served.get("/api/survey")["revision"] == revision


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_other_sites_read_nothing(served, site):
    """J03: a picture or script of another site of this machine, whose cookie the browser does send."""
    for method, path in routes(served):
        if method == "GET":
            assert served.client.get(path, headers={"Sec-Fetch-Site": site}).status_code == 403
            foreign = served.client.get(path, headers={"Origin": "http://evil.example"})
            assert foreign.status_code == 403


@pytest.mark.parametrize("path", SOCKETS)
def test_sockets_open_only_for_the_page(served, path):
    """J04: refused before they are accepted."""
    own = (f"Host: {served.host}", f"Cookie: {served.cookie_header}")
    for origin in FOREIGN_ORIGINS:
        assert handshake(served, path, *own, *origin).status == 403, origin
    origin = f"Origin: {served.url}"
    assert handshake(served, path, f"Host: {served.host}", origin).status == 403
    for hosts in foreign_hosts(served.port):
        answer = handshake(served, path, *hosts, f"Cookie: {served.cookie_header}", origin)
        assert answer is None or answer.status in (400, 403), hosts
    rebound = f"evil.example:{served.port}"
    answer = handshake(
        served, path, f"Host: {rebound}", f"Cookie: {served.cookie_header}", f"Origin: http://{rebound}"
    )
    assert answer.status == 403
    assert handshake(served, path, *own, origin).status == 101


def test_no_other_origin_is_allowed(served):
    """J05: no answer says that another site may read it."""
    for method, path in [*routes(served), ("GET", "/")]:
        for origin in ("http://evil.example", "null", served.url):
            asked = {"Origin": origin, "Access-Control-Request-Method": method}
            with httpx.Client(base_url=served.url) as bare:
                preflight = bare.options(path, headers=asked)
            answers = [preflight, served.client.request(method, path, headers={"Origin": origin})]
            for answer in answers:
                assert not [name for name in answer.headers if name.startswith("access-control-")]
            assert preflight.status_code in (401, 405)


def test_listens_on_this_machine_alone(served):
    """J06."""
    listening = [
        tuple(line.split()[1].split(":"))
        for table in ("tcp", "tcp6")
        for line in Path(f"/proc/{served.process.pid}/net/{table}").read_text().splitlines()[1:]
        if line.split()[3] == "0A" and int(line.split()[1].split(":")[1], 16) == served.port
    ]
    assert listening == [("0100007F", f"{served.port:04X}")]


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.4", "example.org"])
def test_the_network_is_refused(linework, las_file, host):
    """J06: before anything is opened."""
    said = linework("serve", las_file, "--host", host)
    assert said.code == 2
    assert "ssh -L" in said.line
    assert not (las_file.parent / ".linework").exists()


def test_headers(served):
    """J12, J13: on everything, also on refusals and on what is not there."""
    with httpx.Client(base_url=served.url) as stranger:
        answers = [
            served.client.get("/"),
            served.client.get("/api/survey"),
            served.client.get("/api/nothing"),
            served.client.post("/api/changes", json={}),
            served.client.get("/api/survey", headers={"Host": "evil.example"}),
            stranger.get("/api/survey"),
            stranger.get("/?token=abc"),
        ]
    for answer in answers:
        headers = answer.headers
        policy = dict(
            part.strip().partition(" ")[::2] for part in headers["content-security-policy"].split(";")
        )
        assert policy["default-src"] == "'self'"
        assert policy["frame-ancestors"] == "'none'"
        assert policy["base-uri"] == policy["object-src"] == policy["form-action"] == "'none'"
        assert "unsafe" not in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["x-frame-options"] == "DENY"
        assert headers["referrer-policy"] == "no-referrer"
        assert headers["cache-control"] == "no-store"
        assert headers["cross-origin-opener-policy"] == "same-origin"
        assert headers["cross-origin-resource-policy"] == "same-origin"
        assert "server" not in headers


def test_a_report_is_no_part_of_the_page():
    assert "sandbox" in REPORT_POLICY
    assert "allow-" not in REPORT_POLICY
    assert "script" not in REPORT_POLICY


@pytest.mark.parametrize(
    "path",
    ["//evil.example", "/\\evil.example", "/?next=//evil.example", "/?token=abc&next=http://evil.example"],
)
def test_no_open_redirect(served, path):
    """J18: the way to the page is the only one there is."""
    answer = exchange(
        served.port, request("GET", path, f"Host: {served.host}", f"Cookie: {served.cookie_header}")
    )
    assert answer.headers.get("location", "/") == "/"


BROWSER = """\
import os, stat, sys, urllib.parse
page = urllib.parse.unquote(sys.argv[1].removeprefix("file://"))
with open({out!r}, "w") as out:
    print(sys.argv[1], oct(stat.S_IMODE(os.stat(page).st_mode)), os.stat(os.path.dirname(page)).st_mode & 0o77, file=out)
    print(open(page).read(), file=out)
os.rename({out!r}, {out!r} + ".done")
"""


def test_other_users_do_not_see_the_token(las_file, tmp_path):
    """J23: the browser is given a file of mode 0600; no command line holds the token."""
    script, out = tmp_path / "browser.py", tmp_path / "out"
    script.write_text(BROWSER.format(out=str(out)))
    environment = os.environ | {
        "DISPLAY": ":0", "BROWSER": f"{sys.executable} {script} %s", "PYTHONUNBUFFERED": "1"
    }  # fmt: skip
    process = subprocess.Popen(
        [sys.executable, "-m", "linework", "serve", las_file],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
    )  # fmt: skip
    try:
        link = process.stdout.readline().strip()
        token = link.partition("token=")[2]
        assert token, process.stderr.read()
        done = Path(f"{out}.done")
        wait_until(done.exists)
        first, content = done.read_text().split("\n", 1)
        uri, mode, others = first.split()
        assert uri.startswith("file:///")
        assert (mode, others) == ("0o600", "0")
        assert token not in first
        assert token in content
        commands = [p.read_bytes() for p in Path("/proc").glob("[0-9]*/cmdline") if os.access(p, os.R_OK)]
        assert not any(token.encode() in command for command in commands)
    finally:
        process.terminate()
        process.communicate(timeout=30)
    # On a loaded machine it may be ended by force, and leaves no link behind all the same
    assert process.returncode in (143, -signal.SIGTERM)
    assert not Path(uri.removeprefix("file://")).exists()


def test_without_a_screen_nothing_is_opened(monkeypatch):
    from linework.cli.commands import serve as browser

    opened = []
    monkeypatch.setattr(browser, "_open", opened.append)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    with browser.opened_browser("http://127.0.0.1:1/?token=abc"):
        assert opened == []
    monkeypatch.setenv("DISPLAY", ":0")
    with browser.opened_browser("http://127.0.0.1:1/?token=abc"):
        wait_until(lambda: len(opened) == 1)
        page = Path(opened[0].removeprefix("file://"))
        assert stat.S_IMODE(page.stat().st_mode) == 0o600
    assert not page.exists()
