import type { App, Pane } from "./app";
import { element } from "./element";

export class AttributesPane implements Pane {
  readonly element = element("div", { class: "attributes-pane" });

  constructor(readonly app: App) {}
}
