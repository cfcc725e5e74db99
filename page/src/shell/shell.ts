// The layout: toolbar at the top, review and attributes on the left, the plan, the other views on the right, the status
// bar at the bottom.

import type { App } from "../app/app";
import { AlikePane } from "../review/alike-pane";
import { AttributesPane } from "../review/attributes-pane";
import { element } from "../controls/element";
import { EvidencePane } from "../review/evidence-pane";
import { HistoryPane } from "../review/history-pane";
import { ExportPane } from "../review/export-pane";
import { JobPane } from "../review/job-pane";
import { LineTable } from "../review/line-table";
import { Photolog } from "../stereo/photolog";
import { PlanView } from "../plan/plan-view";
import { QueuePane } from "../review/queue-pane";
import { SectionView } from "../section/section-view";
import { StatusBar } from "./status-bar";
import { StraightenedView } from "../straightened/straightened-view";
import { StereoView } from "../stereo/stereo-view";
import { type Pane, Tabs } from "../controls/tabs";
import { View3D } from "../view3d/view3d";
import { Toolbar } from "./toolbar";

function place(id: string): HTMLElement {
  const found = document.getElementById(id);
  if (found === null) throw new Error(`index.html has no element #${id}`);
  return found;
}

export function buildShell(app: App): void {
  const plan = new PlanView(app);
  place("plan").append(plan.element);
  place("bar").append(new Toolbar(app, plan).element);
  place("status").append(new StatusBar(app, plan).element);

  const lists = new Tabs("Review");
  lists.add("Queue", new QueuePane(app, (box) => plan.fit(box)));
  lists.add("Alike", new AlikePane(app, (box) => plan.fit(box), () => lists.show("Alike")));
  lists.add("History", new HistoryPane(app));
  lists.add("Extract", guarded(() => new JobPane(app)));
  const table = new LineTable(app);
  lists.add("Export", new ExportPane(app, () => table.shown()));
  const attributes = new AttributesPane(app, plan.commands);
  place("side").append(lists.element, attributes.element);

  // Views need their data: points for 3-D and section, images for stereo and photolog
  const above = new Tabs("Upper views");
  const below = new Tabs("Lower views");
  if (app.survey.n_points > 0) {
    above.add("3-D", guarded(() => new View3D(app)));
    below.add("Section", guarded(() => new SectionView(app)));
  }
  if (app.survey.n_pairs > 0) {
    above.add("Stereo", guarded(() => new StereoView(app)));
    below.add("Photolog", guarded(() => new Photolog(app)));
  }
  below.add("Straightened", guarded(() => new StraightenedView(app)));
  below.add("Evidence", new EvidencePane(app));
  below.add("Lines", table);
  app.on("item", (item) => item && below.offer("Evidence"));
  const groups = [above, below].filter((group) => group.element.querySelector(".pane") !== null);
  for (const group of groups) wideButton(group);
  place("views").append(...groups.map((group) => group.element));
  place("views").hidden = groups.length === 0;
  place("views").before(splitter(place("work")));
  bindParts(app);
}

// F6 goes from part to part of the page: the lists, the plan, each group of views
function bindParts(app: App): void {
  const parts = (): HTMLElement[] =>
    [...document.querySelectorAll<HTMLElement>("#side [role=tab][aria-selected=true], #plan .map, #views [role=tab][aria-selected=true]")]
      .filter((part) => part.offsetParent !== null);
  const go = (by: 1 | -1): void => {
    const all = parts();
    const within = document.activeElement?.closest("#side, #plan, #views .tab-group") ?? null;
    const at = all.findIndex((part) => within?.contains(part));
    all[at < 0 ? (by > 0 ? 0 : all.length - 1) : (at + by + all.length) % all.length]?.focus();
  };
  const group = "Page";
  app.keyboard.bind({ keys: ["F6"], title: "Next part of the page", group, run: () => go(1) });
  app.keyboard.bind({ keys: ["Shift+F6"], title: "Previous part of the page", group, run: () => go(-1) });
}

// A view that cannot be created shows the error in its place; the others still work
function guarded(make: () => Pane): Pane {
  try {
    return make();
  } catch (error) {
    reportError(error);
    const text = error instanceof Error ? error.message : String(error);
    return { element: element("div", {}, element("p", { class: "empty", role: "alert" }, `This view is not available: ${text}`)) };
  }
}

// A button that gives one group of views the full height and half the width, as the stereo view needs
function wideButton(group: Tabs): void {
  const work = place("work");
  const toggle = element("button", {
    type: "button", class: "wide", "aria-label": `Enlarge ${group.name.toLowerCase()}`, "aria-pressed": "false", title: "Enlarge or restore",
    click: () => {
      const wide = work.dataset.wide === group.name ? "" : group.name;
      work.dataset.wide = wide;
      for (const other of work.querySelectorAll<HTMLElement>("#views .tab-group")) {
        other.hidden = wide !== "" && other.dataset.group !== wide;
        other.querySelector(".wide")?.setAttribute("aria-pressed", String(other.dataset.group === wide));
      }
    },
  }, "⤢");
  group.row.append(toggle);
}

const SIDE_PX = 290; // minimum width of the left column and the splitter, as in shell.css
const MIN_WIDTH_PX = 240; // of the plan and of the views

// The bar between the plan and the other views, moved by dragging or with the arrow keys
function splitter(work: HTMLElement): HTMLElement {
  const bar = element("div", {
    class: "splitter", role: "separator", tabindex: 0, "aria-orientation": "vertical", "aria-label": "Resize the views",
  });
  const set = (width_px: number) => {
    const max_px = work.clientWidth - SIDE_PX - MIN_WIDTH_PX;
    work.style.setProperty("--views-width", `${Math.round(Math.min(Math.max(width_px, MIN_WIDTH_PX), max_px))}px`);
  };
  const width = () => work.getBoundingClientRect().right - bar.getBoundingClientRect().right;
  bar.addEventListener("pointerdown", (event) => {
    bar.setPointerCapture(event.pointerId);
    bar.onpointermove = (move) => set(work.getBoundingClientRect().right - move.clientX);
  });
  bar.addEventListener("pointerup", () => (bar.onpointermove = null));
  bar.addEventListener("keydown", (event) => {
    const step = event.key === "ArrowLeft" ? 40 : event.key === "ArrowRight" ? -40 : 0;
    if (step !== 0) set(width() + step);
  });
  return bar;
}
