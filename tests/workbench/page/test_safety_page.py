"""The page in a real browser: the way in, and names that would like to be more than names (J11, J12, J18)."""

from __future__ import annotations

import shutil

import pytest
from tests.workbench.serve_process import Served, opened_page, served_survey, wait_until

from linework.cli.commands.serve import opened_browser as opened_by_linework

HOSTILE = '<img src=x onerror="window.hit=1"><script>window.hit=1</script>'
#: What the browser refused, kept by a script that runs before those of the page.
WATCH = (
    "window.refused = []; addEventListener('securitypolicyviolation', e => refused.push(e.violatedDirective))"
)


@pytest.fixture(scope="module")
def hostile(made_drive, made_lines, tmp_path_factory):
    """Return a server of a survey whose every name is markup."""
    survey = tmp_path_factory.mktemp("hostile") / "drive"
    shutil.copytree(made_drive, survey)
    shutil.copy(made_lines, survey / "lines.gpkg")
    settings = survey / "survey.toml"
    text = settings.read_text().replace('name = "simulated urban 974"', f"name = '{HOSTILE}'")
    assert HOSTILE in text
    settings.write_text(text + '\n[events]\nfile = "events.csv"\n')
    time_s = (survey / "left.csv").read_text().splitlines()[2].split(",")[1]
    (survey / "events.csv").write_text(f"time_s,key,note\n{time_s},k,{HOSTILE}\n")
    with served_survey(survey, "--who", HOSTILE) as served:
        for line in served.get("/api/lines")["lines"][:3]:
            edit = {"action": "set", "ids": [line["id"]], "column": "note", "value": HOSTILE}
            served.post("/api/changes", {"revision": served.get("/api/survey")["revision"], "edit": edit})
        yield served
    shutil.rmtree(survey)


def ready(page):
    page.wait_for_selector("body[data-state=ready]", state="attached")


def test_names_are_text(browser, hostile: Served):
    """J11: the survey's, the user's, notes of lines and of the operator: on the page, as they are, and only that."""
    assert hostile.get("/api/survey")["name"] == HOSTILE
    assert hostile.get("/api/keys")[0]["note"] == HOSTILE
    with opened_page(browser, hostile) as page:
        page.on("dialog", lambda dialog: pytest.fail(dialog.message))
        ready(page)
        for tab in page.get_by_role("tab").all():
            tab.click()
        wait_until(lambda: "onerror" in page.locator("body").inner_text() or "onerror" in page.title())
        assert page.locator("img[src=x]").count() == 0
        assert page.evaluate("window.hit") is None


def test_the_policy_holds_what_the_page_forgets(browser, hostile: Served):
    """J11: had a name become markup, the browser would still not run it, nor ask anybody else."""
    with opened_page(browser, hostile) as page:
        ready(page)
        page.evaluate(WATCH)
        page.evaluate(f"document.body.insertAdjacentHTML('beforeend', {HOSTILE!r})")
        page.evaluate(
            "{ const s = document.createElement('script'); s.textContent = 'window.hit = 1'; document.body.append(s) }"
        )
        fetched = "fetch('http://127.0.0.1:9/x', {mode: 'no-cors'}).then(() => 'sent', () => 'refused')"
        assert page.evaluate(fetched) == "refused"
        wait_until(lambda: page.evaluate("refused.length") >= 3)
        assert set(page.evaluate("refused")) <= {"script-src-elem", "script-src-attr", "connect-src"}
        assert page.evaluate("window.hit") is None


def test_the_page_keeps_to_its_policy(browser, hostile: Served):
    inside = browser.new_context()
    name, value = hostile.cookie
    inside.add_cookies([{"name": name, "value": value, "url": hostile.url, "sameSite": "Strict"}])
    inside.add_init_script(WATCH)
    asked: list[str] = []
    page = inside.new_page()
    page.on("request", lambda request: asked.append(request.url))
    page.goto(hostile.url)
    ready(page)
    for tab in page.get_by_role("tab").all():
        tab.click()
    assert page.evaluate("refused") == []
    inside.close()
    assert all(url.startswith((hostile.url, "data:", "blob:")) for url in asked), asked


def test_the_way_in(browser, hostile: Served, monkeypatch):
    """J12: from the file that linework gives the browser to the page, whose address holds no token any more."""
    link = next(line for line in hostile.stderr if "for another browser" in line).split(": ", 1)[1].strip()
    opened: list[str] = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr("linework.cli.commands.serve._open", opened.append)
    with opened_by_linework(link):
        wait_until(lambda: len(opened) == 1)
        inside = browser.new_context()
        page = inside.new_page()
        page.goto(opened[0])
        page.wait_for_url(f"{hostile.url}/")
        ready(page)
        assert "token" not in page.url
        assert page.evaluate("document.cookie") == ""
        assert page.evaluate("document.referrer") == ""
        (cookie,) = inside.cookies()
        assert (cookie["httpOnly"], cookie["sameSite"]) == (True, "Strict")
        inside.close()


def test_a_stranger_sees_how_to_get_in(browser, hostile: Served):
    inside = browser.new_context()
    page = inside.new_page()
    page.goto(hostile.url)
    wait_until(lambda: "link" in page.locator("body").inner_text())
    inside.close()


def test_no_other_page_can_hold_or_read_it(browser, hostile: Served, tmp_path):
    """J12: not in a frame, not as a script, not as a picture, though the browser has the cookie."""
    inside = browser.new_context()
    name, value = hostile.cookie
    inside.add_cookies([{"name": name, "value": value, "url": hostile.url, "sameSite": "Strict"}])
    other = tmp_path / "other.html"
    other.write_text(
        f'<!doctype html><iframe src="{hostile.url}/"></iframe>'
        f'<img src="{hostile.url}/api/pairs/0/left" onload="window.got=1"><script src="{hostile.url}/index.js"></script>'
    )
    page = inside.new_page()
    failed: list[str] = []
    page.on("requestfailed", lambda request: failed.append(request.url))
    page.goto(other.as_uri())
    wait_until(
        lambda: (
            {f"{hostile.url}/", f"{hostile.url}/index.js", f"{hostile.url}/api/pairs/0/left"} <= set(failed)
        )
    )
    assert page.evaluate("window.got") is None
    inside.close()
