"""Two real surveys worked through in the workbench as a surveyor does, with a picture of every step.

    python -m benchmarks.surveyor_sessions --data DIR -o OUT [--surveys here-a22,stereo-ramp]

Extracts each survey, opens the workbench in a real browser, and works: the review queue item by item, as it was decided by
the evidence that the page shows (`_surveyor_decisions`; an item on which nothing was decided is left), a line joined and
its attributes set, a missing line followed from one click, what cannot be followed drawn, a node corrected in the
straightened view, GeoPackage and DXF exported. OUT gets a page with all steps and pictures for each survey, the lines
before and after, and the exports. Needs a browser; the pictures show data that is not ours, and stay out of the repository.
"""

from __future__ import annotations

import argparse
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks._real_worlds import checked_data, false_m, judged
from benchmarks._references import FOLDER, read_reference
from benchmarks._surveyor_decisions import HERE_A22, STEREO_RAMP, decided
from benchmarks.same_lines import timed_path

#: Works with data that is not ours, in a browser: run where it is asked for.
ON_REQUEST = True


@dataclass(frozen=True)
class Surveyed:
    """A real survey: its data, how it is given to the commands, the decisions, and what is done after the queue."""

    name: str
    data: str
    options: object
    decisions: tuple
    after: object
    by_hand: tuple


def main(arguments=()):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.surveyor_sessions")
    parser.add_argument("--data", help="folder of real surveys")
    parser.add_argument(
        "-o",
        dest="out",
        type=Path,
        required=True,
        help="folder of the records, with one for each survey",
    )
    parser.add_argument("--surveys", default="here-a22,stereo-ramp")
    options = parser.parse_args(list(arguments))
    data, known = checked_data(options.data), {survey.name: survey for survey in SURVEYS}
    wanted = options.surveys.split(",")
    if unknown := set(wanted) - set(known):
        raise SystemExit(f"no session for {', '.join(sorted(unknown))}: choose from {', '.join(known)}")
    for name in wanted:
        session(known[name], data, options.out / name)


def session(survey, data, out):
    """Extract, work and record one survey."""
    from tests.workbench import serve_process

    from benchmarks._surveyor_desk import LARGE, Desk, record_of
    from linework.cli.app import main as linework
    from linework.files.vectors.read_write import read_lines

    print(f"== {survey.name}", flush=True)
    if out.exists():
        raise SystemExit(f"{out} exists: give -o another folder")
    out.mkdir(parents=True)
    given = [str(data / survey.data), *survey.options(data, out)]
    lines = out / "lines.gpkg"
    if linework(["extract", *given, "-o", str(lines), "--work", str(out / "work"), "--quiet"]) != 0:
        raise SystemExit(f"{survey.name}: extraction failed")
    shutil.copy(lines, out / "before.gpkg")
    reference = read_reference(FOLDER / f"{survey.name}.toml", data)
    serve_process.START_S = 3600.0
    desk, undecided, tables, told = Desk(None, None, out), [], [], "it broke off"
    try:
        began = time.perf_counter()
        with (
            serve_process.served_survey(*given, "--work", out / "work", lines=lines) as served,
            serve_process.opened_browser() as browser,
        ):
            desk.served, desk.browser = served, browser
            with desk.open():
                with desk.step("The survey as it opens"):
                    pass
                undecided = work_queue(desk, survey.decisions)
                survey.after(desk)
                exported(desk, out)
            with desk.open(**LARGE), desk.step("The lines as they are now, in a large dark window"):
                desk.plan.look_at_all()
            worked_s = time.perf_counter() - began
        before, after = read_lines(out / "before.gpkg"), read_lines(lines)
        tables = [lengths_table(before, after), scores_table(before, after, reference)]
        told = f"{desk.actions} keys and clicks that change or settle something, {worked_s:.0f} s of the program's time with all pictures"
    finally:
        left = [*survey.by_hand, *(f"to be decided: {one}" for one in undecided)]
        (out / "record.html").write_text(
            record_of(f"{survey.name}: {told}", tables, desk.steps, left), encoding="utf-8"
        )
    for title, head, rows in tables:
        print(title)
        for row in (head, *rows):
            print("  " + "  ".join(f"{cell:>18}" for cell in row))
    print(f"{told}; {len(undecided)} items without a decision")


def work_queue(desk, decisions):
    """Work through the queue, the stretches of road last; return what was left without a decision, in words."""
    left, unused = {}, list(decisions)
    while items := [item for item in desk.items() if item["key"] not in left]:
        item = min(items, key=lambda item: item["type"] == "stretch")
        with desk.step(f"Look at: {item['type']} {item['kind']}", item["reason"]):
            desk.page.locator(f".queue [data-key='{item['key']}']").click()
        decision = decided(unused, item)
        if decision is None:
            at = f"{item['at'][0]:.1f}, {item['at'][1]:.1f}"
            left[item["key"]] = f"{item['type']} {item['kind']} at {at}: {item['reason']}"
            continue
        unused.remove(decision)
        with desk.step(f"Key {decision.key.upper()}", decision.why, actions=1):
            desk.changed(decision.key)
    return list(left.values())


def exported(desk, out):
    """Export GeoPackage and DXF from the page, into the record's folder."""
    desk.show("Export")
    for ending in ("gpkg", "dxf"):
        with desk.step(f"Export .{ending}", actions=1):
            desk.page.select_option("select[name=format]", ending)
            with desk.page.expect_download() as coming:
                desk.page.locator(".export-pane .start").click()
            name = coming.value.suggested_filename
            coming.value.save_as(out / f"exported-{name}")
    desk.show("Queue")


def after_a22(desk):
    """The far rail in one piece, the role of a line, the ends of the kerb, a node, a sample in the straightened view."""
    first, second = (
        desk.line_near("guardrail", place) for place in ((657299.49, 5085369.02), (657303.14, 5085376.50))
    )
    joined(desk, "The far rail in one piece", first, second)
    inner = desk.line_near("lane_marking", (657311.757, 5085357.313))
    if inner and desk.select(inner):
        with desk.step(
            "Role edge",
            "the inner line of the median's double edge line was taken for a lane line",
            actions=2,
        ):
            desk.changed("e")
    followed(desk, (657315.0, 5085330.4), "road_boundary", "the kerb goes on to the end of the points")
    followed(desk, (657314.6, 5085330.3), "lane_marking", "the edge line goes on to the end of the points")
    unrolled(desk, desk.line_near("lane_marking", (657315.187, 5085356.376)))


def after_ramp(desk):
    """The edge line in one piece, dashes split from the solid edge, a missing line followed in an image, one drawn, a node."""
    first, second = (
        desk.line_near("lane_marking", place) for place in ((19.6955, -31.696), (15.5611, -59.2604))
    )
    joined(desk, "The right edge line in one piece", first, second)
    long = desk.line_near("lane_marking", (5.4453, 2.1999))
    if long and desk.select(long):
        with desk.step(
            "Split where the chevrons end", "solid edge before, dashes of the through lane after", actions=1
        ):
            desk.plan.look_at((23.88, -29.99), nearer=1)
            desk.page.mouse.move(*desk.plan.pixel((23.88, -29.99)))
            desk.changed("t")
        part = desk.line_near("lane_marking", (20.6872, -51.681))
        if part and desk.select(part):
            with desk.step("Pattern dashed, role lane", "", actions=2):
                desk.changed("h")
                desk.changed("l")
    in_image(desk)
    drawn(
        desk,
        "lane_marking",
        OUTER_EDGE,
        "the outer edge of the chevrons, which following in the image does not find",
    )
    unrolled(desk, desk.line_near("lane_marking", (17.451, -15.378)))


#: The outer edge line of the chevrons, as the road image shows it. [m]
OUTER_EDGE = ((24.9, -12.1), (25.6, -14.6), (26.1, -17.2), (26.3, -19.8))


def joined(desk, did, *names):
    if all(names) and len(set(names)) == 2 and desk.select(*names):
        with desk.step(did, "they are in line, and both were accepted", actions=3):
            desk.changed("j")


def followed(desk, place, kind, why):
    """Follow from one click, and keep what grows if it is a line of the kind."""
    desk.plan.follow(place, kind)
    with desk.step(f"Follow: click on a {kind}", why, actions=1):
        state = desk.grown()
    if state == "stopped":
        with desk.step("Keep it", actions=1):
            desk.changed("Enter")
    desk.plan.press("Escape", "v")


def in_image(desk):
    """Follow the outer edge of the chevrons in the stereo view."""
    page = desk.page
    desk.show("Stereo")
    desk.plan.look_at((26.0, -16.5))
    desk.quiet()
    desk.plan.press("f")
    page.select_option("select[name=kind]", "lane_marking")
    box = page.locator(".stereo-view canvas[data-side=left]").bounding_box()
    with desk.step("Follow in the left image", "the outer edge of the chevrons", actions=1):
        page.mouse.click(box["x"] + 0.30 * box["width"], box["y"] + 0.62 * box["height"])
        state = desk.grown()
    if state == "stopped":
        with desk.step("Cancel it", "it is not the edge that was clicked", actions=1):
            desk.plan.press("Escape")
    desk.plan.press("Escape", "v")


def drawn(desk, kind, places, why):
    desk.plan.look_at(tuple(np.mean(places, axis=0)), nearer=1)
    desk.plan.press("d")
    desk.page.select_option("select[name=kind]", kind)
    with desk.step(f"Draw a {kind} with {len(places)} clicks", why, actions=len(places) + 1):
        for place in places:
            desk.plan.click(place)
        desk.changed("Enter")
    desk.plan.press("v")


def unrolled(desk, name):
    """Look along a line in the straightened view, move a node by a centimetre, and take that back: it lay on the paint."""
    if not name or not desk.select(name):
        return
    with desk.step("The line unrolled"):
        desk.show("Straightened")
    view = desk.page.locator(".straightened-view")
    with desk.step("20 m on", actions=0):
        view.press(" ")
    with desk.step("A node 1 cm to the left", "is it better beside its neighbours?", actions=3):
        view.press("ArrowRight")
        view.press("Shift+ArrowUp")
        desk.changed_in(view, "Enter")
    with desk.step("Undo", "it lay on the paint before", actions=1):
        desk.changed("Control+z")
    desk.show("Evidence")


def lengths_table(before, after):
    from benchmarks._surveyor_desk import lengths_of

    was, now = lengths_of(before), lengths_of(after)
    rows = [
        (kind, *(f"{n} / {metres:.1f}" for n, metres in (was.get(kind, (0, 0.0)), now.get(kind, (0, 0.0)))))
        for kind in sorted({*was, *now})
    ]
    return "Lines / metres", ("kind", "extracted", "after the session"), rows


def scores_table(before, after, reference):
    """Completeness, correctness, and false metres by kind, within the area of the reference."""
    was, now = (judged(lines, reference) for lines in (before, after))
    rows = []
    for one, other in zip(was.scores, now.scores, strict=True):
        rows.append((one.kind, f"{one.reference_m:.0f}", *(
            f"{100 * each.at.completeness:.1f} / {100 * each.at.correctness:.1f} / {false_m(each):.0f}" for each in (one, other)
        )))  # fmt: skip
    for (kind, metres), (_, later) in zip(was.absent_m, now.absent_m, strict=True):
        rows.append((kind, "0", f"- / - / {metres:.0f}", f"- / - / {later:.0f}"))
    title = f"Complete % / correct % / false m, within {reference.tolerance_m} m of the reference by hand"
    return title, ("kind", "reference m", "extracted", "after the session"), rows


SURVEYS = (
    Surveyed(
        "here-a22",
        "here-a22/here_a22_uniform_south.laz",
        lambda data, out: [
            "--trajectory", str(timed_path(data / "here-a22/trajectory_utm32n.csv", out / "path.csv")), "--crs", "EPSG:32632"
        ],
        HERE_A22,
        after_a22,
        (),
    ),
    Surveyed("stereo-ramp", "stereo-ramp", lambda *_: [], STEREO_RAMP, after_ramp, ()),
)  # fmt: skip


if __name__ == "__main__":
    import sys

    main(tuple(sys.argv[1:]))
