"""The table of lines and the export, as a person uses them."""

from __future__ import annotations

import zipfile

import pytest
from tests.workbench.page.plan_page import PlanPage
from tests.workbench.serve_process import wait_until

from linework.files.vectors.read_write import read_lines


@pytest.fixture
def plan(page, served):
    plan = PlanPage(page, served)
    page.get_by_role("tab", name="Lines", exact=True).click()
    wait_until(lambda: listed(plan) == len(plan.documents()))
    return plan


def listed(plan) -> int:
    return int(plan.page.get_attribute(".line-table", "data-listed") or -1)


def column(plan, number: int) -> list[str]:
    return plan.page.locator(f".line-table .row [aria-colindex='{number}']").all_text_contents()


def test_lines_are_sorted_by_a_column(plan):
    page = plan.page
    heading = page.locator(".line-table [data-column=length]")
    for direction, is_reversed in (("ascending", False), ("descending", True)):
        heading.get_by_role("button").click()
        assert heading.get_attribute("aria-sort") == direction
        lengths = [float(text) for text in column(plan, 2)]
        assert lengths == sorted(lengths, reverse=is_reversed) and len(set(lengths)) > 1


def test_the_filter_is_that_of_the_plan(plan):
    page, lines = plan.page, plan.documents().values()
    page.select_option(".line-table select[aria-label=Kind]", "road_boundary")
    wait_until(lambda: listed(plan) == sum(line["kind"] == "road_boundary" for line in lines))
    assert page.locator("input[name=show-lane_marking]").is_checked() is False
    assert page.locator("input[name=show-road_boundary]").is_checked()
    plan.press("Shift+k")
    wait_until(lambda: listed(plan) == len(lines))
    assert page.locator("input[name=show-lane_marking]").is_checked()
    least = sorted(line["confidence"] for line in lines)[len(lines) // 2]
    page.locator("input[name=least-confidence]").fill(f"{least:.2f}")
    expected = sum(line["confidence"] >= float(f"{least:.2f}") for line in lines)
    wait_until(lambda: listed(plan) == expected)
    page.get_by_role("button", name="Show all lines again", exact=True).click()
    wait_until(lambda: listed(plan) == len(lines))
    page.locator("input[name=greatest-sigma]").fill("0.01")
    page.locator("input[name=greatest-sigma]").press("Enter")
    wait_until(lambda: listed(plan) < len(lines))


def test_rows_are_selected_by_mouse_and_keys(plan):
    page = plan.page
    rows = page.locator(".line-table .row")
    rows.nth(0).click()
    first = rows.nth(0).get_attribute("data-id")
    assert plan.selected == [first]
    rows.nth(2).click(modifiers=["Shift"])
    assert len(plan.selected) == 3
    rows.nth(1).click(modifiers=["Control"])
    assert len(plan.selected) == 2
    plan.press("Home", "ArrowDown")
    assert plan.selected == [rows.nth(1).get_attribute("data-id")]
    plan.press("Shift+ArrowDown")
    assert len(plan.selected) == 2
    plan.press("Control+a")
    assert len(plan.selected) == listed(plan)


def test_listed_lines_are_edited_together(plan):
    page = plan.page
    page.select_option(".line-table select[aria-label=Kind]", "lane_marking")
    wait_until(lambda: listed(plan) < len(plan.documents()))
    page.get_by_role("button", name="Select all listed lines", exact=True).click()
    chosen = set(plan.selected)
    before = plan.revision
    page.locator("button[data-column=condition][data-value=worn]").click()
    saved = plan.saved_since(before)
    assert {str(name) for name in saved.id[saved.condition == "worn"]} == chosen
    plan.press("Control+z")
    plan.saved_since(before + 1)


def test_kinds_are_hidden_and_shown_alone_by_keys(plan):
    page, lines = plan.page, plan.documents()
    page.locator(".line-table [data-column=kind] button").click()
    wait_until(lambda: page.locator(".line-table .row").count() > 0)
    row = page.locator(".line-table .row").first
    kind = lines[row.get_attribute("data-id")]["kind"]
    row.click()
    plan.press("Shift+l")
    wait_until(lambda: listed(plan) == sum(line["kind"] == kind for line in lines.values()))
    plan.press("Shift+k")
    wait_until(lambda: listed(plan) == len(lines))
    plan.press("Shift+h")
    wait_until(lambda: listed(plan) == sum(line["kind"] != kind for line in lines.values()))
    assert plan.selected == []


def test_what_is_shown_is_exported(plan, tmp_path):
    page = plan.page
    page.select_option(".line-table select[aria-label=Kind]", "road_boundary")
    page.get_by_role("tab", name="Export", exact=True).click()
    page.select_option("select[name=which]", "listed")
    with page.expect_download() as download:
        page.locator(".export-pane .start").click()
    path = tmp_path / download.value.suggested_filename
    download.value.save_as(path)
    assert path.name == "lines.gpkg"
    assert set(read_lines(path).kind) == {"road_boundary"}
    page.wait_for_selector(".export-pane .words li")


def test_a_cad_drawing_by_the_surveys_table(plan, tmp_path):
    page = plan.page
    page.get_by_role("tab", name="Export", exact=True).click()
    page.select_option("select[name=format]", "dxf")
    page.locator("textarea[name=codes]").fill("kind,layer\ncable,A:B\n")
    page.get_by_role("checkbox", name="Layers and codes of this table", exact=True).check()
    page.locator(".export-pane .start").click()
    wait_until(lambda: "A:B" in plan.message)
    page.locator("textarea[name=codes]").fill("kind,layer,code\nlane_marking,MARK,7\n")
    with page.expect_download() as download:
        page.locator(".export-pane .start").click()
    download.value.save_as(tmp_path / "lines.zip")
    with zipfile.ZipFile(tmp_path / "lines.zip") as archive:
        assert b"MARK" in archive.read("lines.dxf")
    assert (
        plan.served.lines.parent / "lines.codes.csv"
    ).read_text() == "kind,layer,code\nlane_marking,MARK,7\n"
