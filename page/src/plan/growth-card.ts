// The card over the plan: the state of the line being followed, and what can be done next, with the keys for it.

import { searchArea } from "../app/api";
import type { App } from "../app/app";
import { planLength } from "../app/geometry";
import { element } from "../controls/element";
import type { End, Growth } from "../app/following";
import { keyButton } from "../controls/keyboard";
import { searchAreaPanel } from "./search-area";

export class GrowthCard {
  readonly element = element("div", { class: "growth-card", role: "status", "aria-live": "polite", hidden: true });

  constructor(private readonly app: App) {
    this.bindKeys();
    app.on("growth", (growth) => this.show(growth));
  }

  private bindKeys(): void {
    const { keyboard, following } = this.app;
    const group = "Follow a line";
    // While a line is being followed, no key may edit another line
    const always = [group, "Plan", "Tools", "Page"];
    keyboard.only = () => {
      const { state } = following.growth;
      return state === "idle" ? null : state === "refused" ? [...always, "Review"] : always;
    };
    const is = (...states: Growth["state"][]) => () => states.includes(following.growth.state);
    keyboard.bind({ keys: [" "], title: "Interrupt", group, when: is("growing"), run: () => following.interrupt() });
    keyboard.bind({ keys: ["Enter"], title: "Keep the line", group, when: is("growing", "stopped"), run: () => void following.keep() });
    keyboard.bind({
      keys: ["Backspace"], title: "Remove the last node", group, when: is("growing", "stopped"),
      run: () => following.removeNode("end"),
    });
    keyboard.bind({
      keys: ["Shift+Backspace"], title: "Remove the first node", group, when: is("growing", "stopped"),
      run: () => following.removeNode("start"),
    });
    keyboard.bind({ keys: ["b"], title: "Bridge the gap at the end", group, when: () => following.canBridge("end"), run: () => following.bridge("end") });
    keyboard.bind({ keys: ["Shift+b"], title: "Bridge the gap at the start", group, when: () => following.canBridge("start"), run: () => following.bridge("start") });
    keyboard.bind({ keys: ["c"], title: "Continue from the end: click farther along", group, when: is("stopped"), run: () => following.continueFrom("end") });
    keyboard.bind({ keys: ["Shift+c"], title: "Continue from the start: click farther along", group, when: is("stopped"), run: () => following.continueFrom("start") });
    keyboard.bind({ keys: ["g", "Enter"], title: "Follow at the suggested place", group, when: () => following.hasSuggestion(), run: () => void following.followSuggestion() });
    keyboard.bind({ keys: ["Escape"], title: "Cancel", group, when: () => is("growing", "stopped", "refused")() || following.growth.continueFrom !== null, run: () => following.cancel() });
  }

  private show(growth: Growth): void {
    this.element.hidden = growth.state === "idle" && growth.continueFrom === null;
    this.element.dataset.state = growth.state;
    if (growth.continueFrom !== null) return this.continuing(growth.continueFrom.end);
    if (growth.state === "growing") this.growing(growth);
    if (growth.state === "stopped") this.stopped(growth);
    if (growth.state === "refused") this.refused(growth);
  }

  private continuing(end: End): void {
    this.fill(`Continue from the ${end}`, ["Click farther along the line, where it is visible again."], [
      keyButton("Escape", "Cancel", () => this.app.following.cancel()),
    ]);
  }

  private growing(growth: Growth): void {
    const line = growth.lines[0];
    const text = line ? `${this.app.title(line.kind)}: ${lengthOf(growth)} m …` : "Searching for a line …";
    this.fill(text, [], [
      keyButton(" ", "Interrupt", () => this.app.following.interrupt()),
      keyButton("Escape", "Cancel", () => this.app.following.cancel()),
    ]);
  }

  private stopped(growth: Growth): void {
    const { following } = this.app;
    const kind = growth.lines[0]?.kind ?? "";
    const bridge = (end: End) => keyButton(end === "end" ? "b" : "Shift+b", `Bridge at the ${end}`, () => following.bridge(end));
    const reasons = (["start", "end"] as const).flatMap((end, i) => {
      const reason = growth.stops[i === 0 ? 0 : 1];
      return reason ? [`At the ${end}: ${reason}`] : [];
    });
    const beside = growth.lines.filter(({ method }) => method === "template").length;
    if (beside > 0) reasons.push(`Template: ${beside} ${beside === 1 ? "line" : "lines"} beside it`);
    if (kind === "cable") reasons.push("Keep it, then Shift W follows it from pole to pole, Shift V with the wires beside it.");
    if (kind === "guardrail" || kind === "barrier") reasons.push("Keep it, then Shift G adds the other rail, if it stands on a median.");
    if (growth.left_out) reasons.push(`Without template ${growth.left_out}: interrupted`);
    if (growth.unseen.length > 0) reasons.push(`Not seen: ${growth.unseen.join(", ")}`);
    this.fill(`${this.app.title(kind)}: ${lengthOf(growth)} m${growth.interrupted ? ", interrupted" : ""}`, reasons, [
      keyButton("Enter", "Keep", () => void following.keep(), { class: "main" }),
      ...(["end", "start"] as const).filter((end) => following.canBridge(end)).map(bridge),
      keyButton("c", "Continue", () => following.continueFrom("end")),
      keyButton("Backspace", "Remove node", () => following.removeNode("end")),
      keyButton("Escape", "Cancel", () => following.cancel()),
    ]);
  }

  private refused(growth: Growth): void {
    const { following } = this.app;
    const { reason = "", advice = "" } = growth.refusal ?? {};
    const suggestion = following.hasSuggestion() ? [keyButton("g", "Follow there instead", () => void following.followSuggestion(), { class: "main" })] : [];
    this.fill(reason, [advice], [...suggestion, keyButton("Escape", "Close", () => following.cancel())]);
    if (growth.at !== null) void this.explain(growth);
  }

  // What the search area shows says more than the reason
  private async explain(growth: Growth): Promise<void> {
    if (growth.at === null) return;
    const area = await searchArea(growth.at).catch(() => null);
    const { state, at } = this.app.following.growth;
    if (area === null || state !== "refused" || at !== growth.at) return;
    this.element.querySelector(".search-area")?.remove();
    this.element.querySelector(".buttons")?.before(searchAreaPanel(area));
  }

  private fill(title: string, lines: string[], buttons: HTMLElement[]): void {
    this.element.replaceChildren(
      element("strong", {}, title),
      ...lines.filter(Boolean).map((text) => element("p", {}, text)),
      element("div", { class: "buttons" }, ...buttons),
    );
  }
}

function lengthOf(growth: Growth): string {
  return planLength(growth.lines[0]?.xyz ?? []).toFixed(1);
}
