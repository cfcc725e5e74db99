// The history: each edit with its author and time, newest first. A click selects the lines it changed.

import * as api from "../app/api";
import type { App } from "../app/app";
import { actionTitle } from "./action-titles";
import type { Pane } from "../controls/tabs";
import { element } from "../controls/element";
import type { EditRecord } from "../app/documents";

export class HistoryPane implements Pane {
  readonly element = element("div", { class: "history-pane" });
  private readonly list = element("ol", { class: "records", "aria-label": "Edits, newest first" });
  private latest = 0; // number of the newest request; older answers are dropped

  constructor(private readonly app: App) {
    this.element.append(this.list);
    app.on("lines", () => void this.refresh());
  }

  resized(): void {
    void this.refresh();
  }

  private async refresh(): Promise<void> {
    if (this.element.hidden) return;
    const request = (this.latest += 1);
    try {
      const records = await api.history();
      if (request !== this.latest) return;
      this.list.replaceChildren(...records.toSorted((a, b) => b.number - a.number).map((record) => this.row(record)));
      if (records.length === 0) this.list.append(element("li", { class: "empty" }, "No edits yet."));
    } catch (error) {
      this.app.reportProblem(error);
    }
  }

  private row(record: EditRecord): HTMLElement {
    const when = new Date(record.time_utc);
    const n = record.ids.length;
    const action = actionTitle(record.action);
    const what = record.undoes > 0 ? `${action} of ${record.undoes}` : action;
    const row = element("button", {
      type: "button", class: record.undone ? "record undone" : "record",
      title: `${when.toLocaleString()}, ${record.who || "unknown"}: ${record.ids.join(", ")}`,
      click: () => this.app.select(record.ids),
    },
    element("span", { class: "number" }, `${record.number}`),
    element("span", { class: "what" }, `${what}, ${n} line${n === 1 ? "" : "s"}`),
    element("span", { class: "who" }, record.who),
    element("time", { datetime: record.time_utc }, when.toLocaleTimeString([], { hour12: false })));
    return element("li", {}, row);
  }
}
