// What can be read in a section, as a table.

import type { App } from "../app/app";
import { element } from "../controls/element";
import type { Reading } from "./nodes";

export function sectionTable(readings: readonly Reading[], app: App): HTMLTableElement {
  const heads = ["Line", "Offset m", "Above road m", ""].map((text) => element("th", {}, text));
  const rows = readings.map((reading) => rowOf(reading, app));
  return element("table", {}, element("thead", {}, element("tr", {}, ...heads)), element("tbody", {}, ...rows));
}

function rowOf(reading: Reading, app: App): HTMLTableRowElement {
  const swatch = element("i", { class: "swatch" });
  swatch.style.background = app.colour(reading.kind);
  const title = app.title(reading.kind);
  const cells = [reading.offset_m.toFixed(3), reading.above_m?.toFixed(3) ?? "–", reading.words];
  return element(
    "tr",
    {
      "data-id": reading.id,
      class: app.selection.includes(reading.id) ? "chosen" : "",
      click: () => app.select([reading.id]),
    },
    element("td", {}, swatch, title),
    ...cells.map((text) => element("td", {}, text)),
  );
}
