import type { App, Pane } from "./app";
import { element } from "./element";

export class PlanView implements Pane {
  readonly element = element("div", { class: "plan-view" });

  constructor(readonly app: App) {}
}
