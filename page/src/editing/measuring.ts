// Measuring: the distance along clicks, and the height difference where heights are known.

import * as api from "../app/api";
import type { App } from "../app/app";
import { ClickPath } from "./click-path";
import type { Place } from "../app/documents";

export class Measuring {
  readonly path: ClickPath;
  private heights: (number | null)[] = [];

  constructor(private readonly app: App) {
    this.path = new ClickPath("#ffb000", () => this.say());
    const when = () => app.tool === "measure" && this.path.places.length > 0;
    const group = "Measure";
    app.keyboard.bind({ keys: ["Backspace"], title: "Take the last place back", group, when, run: () => this.path.back() });
    app.keyboard.bind({ keys: ["Escape"], title: "Measure anew", group, when, run: () => this.path.clear() });
  }

  async click(place: Place): Promise<void> {
    this.path.add(place);
    const places = this.path.places;
    try {
      const { heights } = await api.heights("road_boundary", places);
      if (places === this.path.places) this.heights = heights;
    } catch {
      this.heights = []; // a distance is worth telling without heights
    }
    this.say();
  }

  private say(): void {
    const { places } = this.path;
    if (places.length < 2) return;
    let length_m = 0;
    places.forEach((place, i) => {
      const before = places[i - 1];
      if (before) length_m += Math.hypot(place[0] - before[0], place[1] - before[1]);
    });
    const [first, last] = [this.heights[0] ?? null, this.heights[places.length - 1] ?? null];
    const rise = first === null || last === null ? "height difference not known" : `height difference ${signed(last - first)} m`;
    this.app.emit("message", { text: `Distance ${length_m.toFixed(2)} m in plan, ${rise}`, kind: "info" });
  }
}

function signed(value: number): string {
  return `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(2)}`;
}
