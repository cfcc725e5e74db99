// The layout: tools above, review and attributes at the left, the plan, the other views at the right, messages below.

import type { App, Pane } from "../app/app";
import { AttributesPane } from "../review/attributes-pane";
import { element } from "../controls/element";
import { HistoryPane } from "../review/history-pane";
import { JobPane } from "../review/job-pane";
import { Photolog } from "../stereo/photolog";
import { PlanView } from "../plan/plan-view";
import { QueuePane } from "../review/queue-pane";
import { SectionView } from "../section/section-view";
import { splitter } from "./splitter";
import { StatusBar } from "./status-bar";
import { StereoView } from "../stereo/stereo-view";
import { Tabs } from "../controls/tabs";
import { ThreeView } from "../view3d/view3d";
import { Toolbar } from "./toolbar";

function place(id: string): HTMLElement {
  const found = document.getElementById(id);
  if (found === null) throw new Error(`The page has no ${id}.`);
  return found;
}

export function shellOf(app: App): void {
  const plan = new PlanView(app);
  place("plan").append(plan.element);
  place("bar").append(new Toolbar(app, plan).element);
  place("status").append(new StatusBar(app, plan).element);

  const lists = new Tabs("Review");
  lists.add("Queue", new QueuePane(app, (box) => plan.fit(box)));
  lists.add("History", new HistoryPane(app));
  lists.add("Extract", made(() => new JobPane(app)));
  const attributes = new AttributesPane(app, plan.commands);
  place("side").append(lists.element, attributes.element);

  // A survey without images has no stereo, one without points no section
  const above = new Tabs("Views above");
  const below = new Tabs("Views below");
  if (app.survey.n_points > 0) {
    above.add("3-D", made(() => new ThreeView(app)));
    below.add("Section", made(() => new SectionView(app)));
  }
  if (app.survey.n_pairs > 0) {
    above.add("Stereo", made(() => new StereoView(app)));
    below.add("Photolog", made(() => new Photolog(app)));
  }
  const groups = [above, below].filter((group) => group.element.querySelector(".pane") !== null);
  for (const group of groups) wideButton(group);
  place("views").append(...groups.map((group) => group.element));
  place("views").hidden = groups.length === 0;
  place("views").before(splitter(place("work")));
}

// A view that cannot be made (a browser without WebGL, say) says so in its place; the others work
function made(make: () => Pane): Pane {
  try {
    return make();
  } catch (error) {
    reportError(error);
    const text = error instanceof Error ? error.message : String(error);
    return { element: element("div", {}, element("p", { class: "empty", role: "alert" }, `This view does not work here: ${text}`)) };
  }
}

// One group over the whole height and half of the width: for the stereo view, which needs it
function wideButton(group: Tabs): void {
  const work = place("work");
  const toggle = element("button", {
    type: "button", class: "wide", "aria-label": `${group.name}: large`, "aria-pressed": "false", title: "Large or small",
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
