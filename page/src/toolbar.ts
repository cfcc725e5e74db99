import type { App, Pane } from "./app";
import { element } from "./element";
import type { PlanView } from "./plan-view";

export class Toolbar implements Pane {
  readonly element = element("div", { class: "toolbar" });

  constructor(readonly app: App, readonly plan: PlanView) {}
}
