"""What the page does with hostile names, and when the server is gone."""

from __future__ import annotations

from tests.workbench.page.plan_page import PlanPage, middle_of
from tests.workbench.serve_process import opened_page, served_survey, wait_until

HOSTILE = "<img src=x onerror=\"document.title='in'\"><script>document.title='in'</script>"


def _line(served):
    return next(line for line in served.get("/api/lines")["lines"] if line["kind"] == "lane_marking")


def test_names_are_never_markup(browser, served_alone):
    line = _line(served_alone)
    served_alone.post("/api/changes", {
        "revision": 0, "edit": {"action": "set", "ids": [line["id"]], "column": "note", "value": HOSTILE},
    })  # fmt: skip
    with opened_page(browser, served_alone) as page:
        dialogs = []
        page.on("dialog", lambda dialog: (dialogs.append(dialog.message), dialog.dismiss()))
        plan = PlanPage(page, served_alone)
        plan.look_at(middle_of(line["xyz"]))
        plan.click(middle_of(line["xyz"]))
        wait_until(lambda: plan.selected == [line["id"]])
        assert page.input_value("input[name=note]") == HOSTILE
        # An error that says it back, as text
        plan.press("/")
        page.fill("input[name=go-to]", HOSTILE)
        plan.press("Enter")
        wait_until(lambda: "onerror" in plan.message)
        page.get_by_role("tab", name="History", exact=True).click()
        page.wait_for_selector(".record")
        assert page.locator("img[src=x]").count() == 0
        assert dialogs == []
        assert page.title() != "in"


def test_edits_wait_for_a_server_that_is_gone(browser, made_drive, made_lines, tmp_path):
    """J22: what is edited meanwhile is kept, said, and saved when the server is back with another link."""
    lines = tmp_path / "lines.gpkg"
    lines.write_bytes(made_lines.read_bytes())
    work = ("--work", tmp_path / "work")
    with served_survey(made_drive, *work, lines=lines) as served:
        line = _line(served)
        with opened_page(browser, served) as page:
            plan = PlanPage(page, served)
            plan.look_at(middle_of(line["xyz"]))
            plan.click(middle_of(line["xyz"]))
            wait_until(lambda: plan.selected == [line["id"]])
            served.process.kill()
            served.process.wait()
            saved = page.locator(".status-bar .saved")
            wait_until(lambda: saved.get_attribute("data-state") == "away")
            plan.press("a", "z")
            wait_until(lambda: "2 edits kept here" in saved.inner_text())
            with served_survey(made_drive, "--port", served.port, *work, lines=lines) as again:
                wait_until(lambda: "link" in plan.message)
                name, value = again.cookie
                page.context.add_cookies([{"name": name, "value": value, "url": again.url}])
                page.reload()
                wait_until(lambda: again.get("/api/survey")["revision"] == 2)
                document = next(d for d in again.get("/api/lines")["lines"] if d["id"] == line["id"])
                assert document["condition"] == "worn"
                assert document["review"] in ("accepted", "edited")
                page.wait_for_selector(".status-bar .saved[data-state=saved]")


def test_light_and_dark(browser, served_alone):
    with opened_page(browser, served_alone, color_scheme="dark") as page:
        PlanPage(page, served_alone)
        theme = "document.documentElement.dataset.theme"
        assert page.evaluate(theme) == "dark"
        page.get_by_label("Light or dark theme", exact=True).click()
        assert page.evaluate(theme) == "light"
        page.reload()
        PlanPage(page, served_alone)
        assert page.evaluate(theme) == "light", "what a person chose stays"


def test_all_keys_are_in_the_help(browser, served_alone):
    with opened_page(browser, served_alone) as page:
        plan = PlanPage(page, served_alone)
        plan.press("?")
        page.wait_for_selector("dialog.help[open]")
        said = page.inner_text("dialog.help")
        for words in ("Interrupt", "Split", "Accept the lines", "condition: worn", "Undo"):
            assert words in said
        # One key, one meaning, among those that always work
        keys = page.locator("dialog.help section:has-text('Attributes') kbd").all_inner_texts()
        assert len(keys) == len(set(keys))


#: Makes the page's connection for messages one that a test can reach.
_REACHABLE = """
  window.WebSocket = class extends WebSocket {
    constructor(url) {
      super(url);
      if (url.endsWith("/api/live")) window.liveSocket = this;
    }
  };
"""


def _drawn_and_deleted(served):
    """Draw a line and delete it, both behind the page's back; return its name."""
    edit = {"action": "draw", "kind": "lane_marking", "xyz": [place[:2] for place in _line(served)["xyz"]]}
    (drawn,) = served.post("/api/changes", {"revision": 0, "edit": edit})["lines"]
    served.post("/api/changes", {"revision": 1, "edit": {"action": "delete", "ids": [drawn["id"]]}})
    return drawn["id"]


def test_an_undo_selects_its_line_where_messages_were_missed(browser, served_alone):
    """A page that has not heard of the last edits fetches them before it selects what the undo brought back."""
    with opened_page(browser, served_alone) as page:
        page.add_init_script(_REACHABLE)
        page.reload()
        plan = PlanPage(page, served_alone)
        wait_until(lambda: page.evaluate("window.liveSocket?.readyState") == 1)
        page.evaluate("liveSocket.onmessage = null")
        drawn = _drawn_and_deleted(served_alone)
        plan.press("Control+z")
        wait_until(lambda: plan.selected == [drawn])
        assert plan.revision == 3


def test_an_answer_older_than_what_came_meanwhile_takes_nothing_away(browser, served_alone):
    with opened_page(browser, served_alone) as page:
        page.add_init_script(_REACHABLE)
        page.reload()
        plan = PlanPage(page, served_alone)
        drawn = _drawn_and_deleted(served_alone)
        wait_until(lambda: plan.revision == 2)
        held = []

        def hold(route):
            if held:
                route.continue_()
            else:
                held.append((route, route.fetch()))

        # For good: playwright stops watching when the last route ends, and misses a request that is made just then
        page.route("**/api/lines?since=2", hold)
        # The connection is lost and comes back: the page fetches what it may have missed
        page.evaluate("liveSocket.close()")
        wait_until(lambda: page.evaluate("true") and held)
        plan.press("Control+z")
        wait_until(lambda: plan.selected == [drawn])
        ((route, answer),) = held
        with page.expect_response("**/api/lines?since=3"):
            route.fulfill(response=answer)
        plan.press("a")
        wait_until(lambda: plan.documents()[drawn]["review"] == "accepted")
        assert plan.selected == [drawn]
