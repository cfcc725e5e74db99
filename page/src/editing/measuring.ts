// Measuring: the plan distance along clicks, and the height difference where heights are known.

import * as api from "../app/api";
import type { App } from "../app/app";
import { planLength } from "../app/geometry";
import { ClickPath } from "./click-path";
import type { Place } from "../app/documents";

export class Measuring {
  readonly path: ClickPath;
  private heights: (number | null)[] = [];

  constructor(private readonly app: App) {
    this.path = new ClickPath("#ffb000", () => this.show());
    const when = () => app.tool === "measure" && this.path.places.length > 0;
    const group = "Measure";
    app.keyboard.bind({ keys: ["Backspace"], title: "Remove the last point", group, when, run: () => this.path.removeLast() });
    app.keyboard.bind({ keys: ["Escape"], title: "Start a new measurement", group, when, run: () => this.path.clear() });
  }

  async click(place: Place): Promise<void> {
    this.path.add(place);
    const places = this.path.places;
    try {
      const { heights } = await api.heights("road_boundary", places);
      if (places === this.path.places) this.heights = heights;
    } catch {
      this.heights = []; // the distance is worth showing without heights
    }
    this.show();
  }

  private show(): void {
    const { places } = this.path;
    if (places.length < 2) return;
    const [first, last] = [this.heights[0] ?? null, this.heights[places.length - 1] ?? null];
    const rise = first === null || last === null ? "height difference unknown" : `height difference ${signed(last - first)} m`;
    this.app.emit("message", { text: `Distance ${planLength(places).toFixed(2)} m in plan, ${rise}`, kind: "info" });
  }
}

function signed(value: number): string {
  return `${value <= -0.005 ? "−" : "+"}${Math.abs(value).toFixed(2)}`;
}
