// Drawing a line by hand: clicks are vertices, and the server adds their heights.

import type { App } from "../app/app";
import { ClickPath } from "./click-path";
import type { Edit, Place } from "../app/documents";
import { headingOf } from "../app/geometry";
import { Snapping } from "./snapping";

export class Drawing {
  readonly path: ClickPath;
  readonly snapping: Snapping;
  private snaps: Promise<void>[] = [];

  constructor(private readonly app: App, resolution: () => number) {
    this.snapping = new Snapping(app, resolution);
    this.path = new ClickPath(app.colour(app.followKind), () => undefined);
    const when = () => app.tool === "draw" && this.path.places.length > 0;
    const group = "Draw";
    app.keyboard.bind({ keys: ["Enter"], title: "Finish the line", group, when, run: () => void this.finish() });
    app.keyboard.bind({ keys: ["Backspace"], title: "Remove the last vertex", group, when, run: () => this.path.removeLast() });
    app.keyboard.bind({ keys: ["Escape"], title: "Discard the line", group, when, run: () => this.path.clear() });
  }

  // `freely`: where it is, whatever edge is near
  click(place: Place, freely: boolean): void {
    if (this.app.followKind === "")
      return this.app.emit("message", { text: "First choose the kind of line to draw.", kind: "problem", place });
    this.path.recolour(this.app.colour(this.app.followKind));
    const heading = this.headingTo(place);
    this.path.add(place);
    if (!freely) this.snaps.push(this.snap(place, heading));
  }

  hover(place: Place, freely: boolean): void {
    this.path.hover(place);
    if (freely) this.snapping.show(null);
    else this.snapping.hover(place, this.headingTo(place));
  }

  private headingTo(place: Place): number | null {
    const last = this.path.places.at(-1);
    return last && (last[0] !== place[0] || last[1] !== place[1]) ? headingOf(last, place) : null;
  }

  // The vertex is there at once, and moves onto its edge when that is found
  private async snap(place: Place, heading_deg: number | null): Promise<void> {
    const found = await this.snapping.find(place, heading_deg);
    if (found) this.path.replace(place, found.at);
    this.snapping.show(found);
  }

  // A double-click finishes the line; its second click has added the last vertex twice
  doubleClick(): void {
    this.path.removeLast();
    void this.finish();
  }

  private async finish(): Promise<void> {
    await Promise.all(this.snaps.splice(0));
    const xyz = this.path.places;
    if (xyz.length < 2)
      return this.app.emit("message", { text: "A line needs at least two vertices.", kind: "problem" });
    this.path.clear();
    const changed = await this.app.change(editOf(this.app.followKind, xyz));
    if (changed) this.app.select(changed.lines.map((line) => line.id));
  }
}

// Three points of a cable are saved as a wire hanging through them
function editOf(kind: string, xyz: Place[]): Edit {
  const [first, between, last, more] = xyz;
  if (kind === "cable" && first && between && last && !more) return { action: "wire", xyz: [first, between, last] };
  return { action: "draw", kind, xyz };
}
