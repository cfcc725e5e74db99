// The status bar: coordinates of the mouse, the scale, messages, and whether everything is saved.

import type { App } from "../app/app";
import { element } from "../controls/element";
import type { PlanView } from "../plan/plan-view";

const PX_PER_M = 96 / 0.0254; // CSS pixels per metre of the screen

export class StatusBar {
  readonly element = element("div", { class: "status-bar" });
  private readonly message = element("span", { class: "message", role: "status", "aria-live": "polite" });
  private readonly saved = element("span", { class: "saved", role: "status" });
  private waiting = 0;
  private isConnected = true;
  private since: Date | null = null;

  constructor(private readonly app: App, private readonly plan: PlanView) {
    const dismiss = element("button", {
      type: "button", class: "dismiss", "aria-label": "Dismiss the message", hidden: true, click: () => this.showMessage("", "info"),
    }, "×");
    this.element.append(this.coordinates(), this.scale(), this.message, dismiss, this.saved);
    app.on("message", ({ text, kind }) => this.showMessage(text, kind));
    app.on("connected", (connected) => {
      this.isConnected = connected;
      this.showSaved();
    });
    app.on("saved", ({ waiting, since }) => {
      if (since !== this.since) this.clearProblem();
      [this.waiting, this.since] = [waiting, since];
      this.showSaved();
    });
    for (const text of app.survey.warnings.slice(0, 1)) this.showMessage(text, "info");
    this.showSaved();
  }

  private coordinates(): HTMLElement {
    const { crs } = this.app.survey;
    const text = element("output", { class: "coordinates", title: crs }, "E –  N –");
    this.app.on("cursor", (cursor) => {
      const [east, north] = cursor?.at ?? [];
      text.textContent = east === undefined || north === undefined ? "E –  N –" : `E ${east.toFixed(2)}  N ${north.toFixed(2)}`;
    });
    return element("span", { class: "where" }, text, element("span", { class: "crs", title: crs }, crs));
  }

  private scale(): HTMLElement {
    const text = element("output", { class: "scale" });
    const show = () => {
      const resolution = this.plan.map.getView().getResolution() ?? 1;
      text.textContent = `1 : ${Number((resolution * PX_PER_M).toPrecision(2)).toLocaleString("en")}`;
    };
    this.plan.map.on("moveend", show);
    return text;
  }

  private showMessage(text: string, kind: "info" | "problem"): void {
    this.message.textContent = text;
    this.message.title = text;
    this.message.dataset.kind = kind;
    const close = this.element.querySelector<HTMLElement>(".dismiss");
    if (close) close.hidden = text === "";
  }

  // An edit was saved, so an earlier problem no longer matters
  private clearProblem(): void {
    if (this.message.dataset.kind === "problem") this.showMessage("", "info");
  }

  private showSaved(): void {
    const { waiting, isConnected, since, saved } = this;
    const edits = `${waiting} edit${waiting === 1 ? "" : "s"}`;
    if (!isConnected) {
      saved.dataset.state = "away";
      saved.textContent = waiting > 0
        ? `The server does not answer: ${edits} kept here, to be sent when it is back`
        : "The server does not answer: reconnecting …";
    } else if (waiting > 0) {
      saved.dataset.state = "saving";
      saved.textContent = `Saving ${edits} …`;
    } else {
      saved.dataset.state = "saved";
      saved.textContent = since ? `Saved ${since.toLocaleTimeString([], { hour12: false })}` : "All edits saved";
    }
  }
}
