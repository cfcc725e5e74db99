import type { App, Pane } from "./app";
import { element } from "./element";

export class QueuePane implements Pane {
  readonly element = element("div", { class: "queue-pane" });

  constructor(readonly app: App) {}
}
