import type { App, Pane } from "./app";
import { element } from "./element";

export class HistoryPane implements Pane {
  readonly element = element("div", { class: "history-pane" });

  constructor(readonly app: App) {}
}
