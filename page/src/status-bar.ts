import type { App, Pane } from "./app";
import { element } from "./element";
import type { PlanView } from "./plan-view";

export class StatusBar implements Pane {
  readonly element = element("div", { class: "status-bar" });

  constructor(readonly app: App, readonly plan: PlanView) {}
}
