// What can be done with the line that is being followed: said in a card over the plan, with the keys that do it.

import type { App } from "../app/app";
import { element } from "../controls/element";
import type { End, Growth } from "../app/following";
import { keyButton } from "../controls/key-button";

export class GrowthCard {
  readonly element = element("div", { class: "growth-card", role: "status", "aria-live": "polite", hidden: true });

  constructor(private readonly app: App) {
    this.bindKeys();
    app.on("growth", (growth) => this.show(growth));
  }

  private bindKeys(): void {
    const { keyboard, following } = this.app;
    const group = "Follow a line";
    // While a line is followed no key may do something to another one
    const always = [group, "Plan", "Tools", "Page"];
    keyboard.only = () => {
      const { state } = following.growth;
      return state === "idle" ? null : state === "refused" ? [...always, "Review"] : always;
    };
    const is = (...states: Growth["state"][]) => () => states.includes(following.growth.state);
    keyboard.bind({ keys: [" "], title: "Interrupt", group, when: is("growing"), run: () => following.interrupt() });
    keyboard.bind({ keys: ["Enter"], title: "Keep it", group, when: is("growing", "stopped"), run: () => void following.keep() });
    keyboard.bind({
      keys: ["Backspace"], title: "Take the last node off", group, when: is("growing", "stopped"),
      run: () => following.takeOff("end"),
    });
    keyboard.bind({
      keys: ["Shift+Backspace"], title: "Take the first node off", group, when: is("growing", "stopped"),
      run: () => following.takeOff("start"),
    });
    keyboard.bind({ keys: ["b"], title: "Bridge the gap at the end", group, when: () => following.canBridge("end"), run: () => following.bridge("end") });
    keyboard.bind({ keys: ["Shift+b"], title: "Bridge the gap at the start", group, when: () => following.canBridge("start"), run: () => following.bridge("start") });
    keyboard.bind({ keys: ["c"], title: "Continue at the end: click farther on", group, when: is("stopped"), run: () => following.goOnFrom("end") });
    keyboard.bind({ keys: ["Shift+c"], title: "Continue at the start: click farther on", group, when: is("stopped"), run: () => following.goOnFrom("start") });
    keyboard.bind({ keys: ["g", "Enter"], title: "Go where it works", group, when: () => following.canGoThere(), run: () => void following.goThere() });
    keyboard.bind({ keys: ["Escape"], title: "Cancel", group, when: () => is("growing", "stopped", "refused")() || following.growth.goesOn !== null, run: () => following.cancel() });
  }

  private show(growth: Growth): void {
    this.element.hidden = growth.state === "idle" && growth.goesOn === null;
    this.element.dataset.state = growth.state;
    if (growth.goesOn !== null) return this.goesOn(growth.goesOn.end);
    if (growth.state === "growing") this.growing(growth);
    if (growth.state === "stopped") this.stopped(growth);
    if (growth.state === "refused") this.refused(growth);
  }

  private goesOn(end: End): void {
    this.fill(`Continue at the ${end}`, ["Click farther along the line, where it can be seen again."], [
      keyButton("Escape", "Cancel", () => this.app.following.cancel()),
    ]);
  }

  private growing(growth: Growth): void {
    const line = growth.lines[0];
    const text = line ? `${this.app.title(line.kind)}: ${lengthOf(growth)} m …` : "Looking for a line …";
    this.fill(text, [], [
      keyButton(" ", "Interrupt", () => this.app.following.interrupt()),
      keyButton("Escape", "Cancel", () => this.app.following.cancel()),
    ]);
  }

  private stopped(growth: Growth): void {
    const { following } = this.app;
    const kind = growth.lines[0]?.kind ?? "";
    const bridge = (end: End) => keyButton(end === "end" ? "b" : "Shift+b", `Bridge at the ${end}`, () => following.bridge(end));
    const whys = (["start", "end"] as const).flatMap((end, i) => {
      const why = growth.stops[i === 0 ? 0 : 1];
      return why ? [`At the ${end}: ${why}`] : [];
    });
    this.fill(`${this.app.title(kind)}: ${lengthOf(growth)} m${growth.interrupted ? ", interrupted" : ""}`, whys, [
      keyButton("Enter", "Keep", () => void following.keep(), { class: "main" }),
      ...(["end", "start"] as const).filter((end) => following.canBridge(end)).map(bridge),
      keyButton("c", "Continue", () => following.goOnFrom("end")),
      keyButton("Backspace", "Node off", () => following.takeOff("end")),
      keyButton("Escape", "Cancel", () => following.cancel()),
    ]);
  }

  private refused(growth: Growth): void {
    const { following } = this.app;
    const { reason = "", advice = "" } = growth.refusal ?? {};
    const there = following.canGoThere() ? [keyButton("g", "Go there instead", () => void following.goThere(), { class: "main" })] : [];
    this.fill(reason, [advice], [...there, keyButton("Escape", "Close", () => following.cancel())]);
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
  const xyz = growth.lines[0]?.xyz ?? [];
  let length_m = 0;
  xyz.forEach((vertex, i) => {
    const before = xyz[i - 1];
    if (before) length_m += Math.hypot(vertex[0] - before[0], vertex[1] - before[1]);
  });
  return length_m.toFixed(1);
}
