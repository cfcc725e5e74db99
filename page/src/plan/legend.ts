// The legend: shows and hides kinds, rejected lines and the vehicle's path, and sets the accuracy bands. Keys hide the
// kinds of the selected lines, show only them, or everything.

import type { App } from "../app/app";
import { REJECTED } from "../app/filter";
import { element } from "../controls/element";
import type { LineLayer } from "./line-layer";

const BANDS: [string, number][] = [["none", 0], ["± 2 σ, true to scale", 2], ["± 2 σ, enlarged 10 times", 20]];

const WIDE_PX = 1600; // in a narrower window the open legend would hide half of the plan

export function legend(app: App, lines: LineLayer, showPath: (visible: boolean) => void): HTMLElement {
  const counts = new Map<string, HTMLElement>();
  // Kinds that a survey without points cannot have are shown once lines have them
  const kinds = app.survey.kinds.filter(({ picked_in_images }) => app.survey.n_points > 0 || picked_in_images).map(({ kind }) => kind);
  // Surveys with images also have lines extracted from images alone
  const inImages = app.survey.n_pairs > 0 ? ["lane_marking_stereo", "lane_marking_dash_stereo"] : [];
  const rows = [...kinds, ...inImages].map((kind) => kindRow(app, kind, app.title(kind), counts));
  const bands = element("select", {
    "aria-label": "Accuracy bands",
    change: (event) => {
      lines.sigmas = Number((event.target as HTMLSelectElement).value);
      lines.restyle();
    },
  }, ...BANDS.map(([title, sigmas]) => element("option", { value: sigmas }, title)));
  app.on("lines", () => count(app, counts));
  bindKeys(app);
  const made = element("details", { class: "legend", open: window.innerWidth >= WIDE_PX },
    element("summary", {}, "Legend"),
    ...rows,
    element("hr"),
    switchRow("Rejected lines", "swatch rejected", (visible) => app.filter.hide(REJECTED, !visible), REJECTED),
    switchRow("Vehicle path", "swatch path", showPath, "path"),
    element("div", { class: "row" }, element("span", { class: "swatch bridged" }), "bridged (not measured)"),
    element("div", { class: "row" }, element("span", { class: "swatch accepted" }), "accepted"),
    element("div", { class: "row" }, element("span", { class: "swatch edited" }), "edited or drawn"),
    element("label", { class: "row" }, "Accuracy", bands),
  );
  app.on("filter", () => {
    for (const name of [...kinds, ...inImages, REJECTED]) {
      const box = made.querySelector<HTMLInputElement>(`input[name="show-${name}"]`);
      if (box) box.checked = !app.filter.hidden.has(name);
    }
  });
  return made;
}

function bindKeys(app: App): void {
  const group = "Plan";
  const selected = () => [...new Set(app.selection.flatMap((id) => app.lines.get(id)?.kind ?? []))];
  const when = () => app.selection.length > 0;
  app.keyboard.bind({
    keys: ["Shift+h"], title: "Hide the kinds of the selected lines", group, when,
    run: () => {
      const kinds = selected();
      app.select([]); // selected lines are always shown
      for (const kind of kinds) app.filter.hide(kind, true);
    },
  });
  app.keyboard.bind({ keys: ["Shift+l"], title: "Show only the kinds of the selected lines", group, when, run: () => app.showOnly(selected()) });
  app.keyboard.bind({ keys: ["Shift+k"], title: "Show all lines", group, run: () => app.filter.clear() });
}

function kindRow(app: App, kind: string, title: string, counts: Map<string, HTMLElement>): HTMLElement {
  const row = switchRow(title, "swatch", (visible) => app.filter.hide(kind, !visible), kind);
  const swatch = row.querySelector<HTMLElement>(".swatch");
  if (swatch) swatch.style.backgroundColor = app.colour(kind);
  const number = element("span", { class: "count" });
  counts.set(kind, number);
  row.append(number);
  return row;
}

function switchRow(title: string, swatch: string, set: (visible: boolean) => void, name: string): HTMLElement {
  const box = element("input", {
    type: "checkbox", checked: true, name: `show-${name}`,
    change: (event) => set((event.target as HTMLInputElement).checked),
  });
  return element("label", { class: "row" }, box, element("span", { class: swatch }), title);
}

function count(app: App, counts: Map<string, HTMLElement>): void {
  const found = new Map<string, number>();
  for (const line of app.lines.values())
    if (line.review !== REJECTED) found.set(line.kind, (found.get(line.kind) ?? 0) + 1);
  for (const [kind, place] of counts) place.textContent = String(found.get(kind) ?? "");
}
