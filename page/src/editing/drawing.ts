// Drawing a line by hand: clicks are vertices, and the server adds their heights.

import type { App } from "../app/app";
import { ClickPath } from "./click-path";
import type { Edit, Place } from "../app/documents";
import { headingOf } from "../app/geometry";
import { Snapping } from "./snapping";

export class Drawing {
  readonly path: ClickPath;
  readonly snapping: Snapping;
  private readonly snaps = new Map<Place, Promise<Place>>(); // by vertex as it was clicked

  constructor(private readonly app: App, resolution: () => number) {
    this.snapping = new Snapping(app, resolution);
    this.path = new ClickPath(app.colour(app.followKind), () => undefined);
    const when = () => app.tool === "draw" && this.path.places.length > 0;
    const group = "Draw";
    app.keyboard.bind({ keys: ["Enter"], title: "Finish the line", group, when, run: () => void this.finish() });
    app.keyboard.bind({ keys: ["Backspace"], title: "Remove the last vertex", group, when, run: () => this.path.removeLast() });
    app.keyboard.bind({ keys: ["Escape"], title: "Discard the line", group, when, run: () => this.clear() });
  }

  // `freely`: where it is, whatever edge is near
  click(place: Place, freely: boolean): void {
    if (this.app.followKind === "")
      return this.app.emit("message", { text: "First choose the kind of line to draw.", kind: "problem", place });
    this.path.recolour(this.app.colour(this.app.followKind));
    const heading = this.headingTo(place);
    this.path.add(place);
    if (!freely) this.snaps.set(place, this.snap(place, heading));
  }

  hover(place: Place, freely: boolean): void {
    this.path.hover(place);
    if (freely) this.snapping.hide();
    else this.snapping.hover(place, this.headingTo(place));
  }

  private headingTo(place: Place): number | null {
    const last = this.path.places.at(-1);
    return last && (last[0] !== place[0] || last[1] !== place[1]) ? headingOf(last, place) : null;
  }

  // The vertex is there at once, and moves onto its edge when that is found
  private async snap(place: Place, heading_deg: number | null): Promise<Place> {
    const found = await this.snapping.marked(place, heading_deg);
    this.snaps.delete(place);
    if (found) this.path.replace(place, found.at);
    return found?.at ?? place;
  }

  private clear(): void {
    this.path.clear();
    this.snapping.hide();
  }

  // A double-click finishes the line; its second click has added the last vertex twice
  doubleClick(): void {
    this.path.removeLast();
    void this.finish();
  }

  private async finish(): Promise<void> {
    const { places } = this.path;
    const kind = this.app.followKind;
    if (places.length < 2)
      return this.app.emit("message", { text: "A line needs at least two vertices.", kind: "problem" });
    const snapped = places.map((place) => this.snaps.get(place) ?? place);
    // What is clicked from here on is of the next line
    this.clear();
    const changed = await this.app.change(editOf(kind, await Promise.all(snapped)));
    if (changed) this.app.select(changed.lines.map((line) => line.id));
  }
}

// Three points of a cable are saved as a wire hanging through them
function editOf(kind: string, xyz: Place[]): Edit {
  const [first, between, last, more] = xyz;
  if (kind === "cable" && first && between && last && !more) return { action: "wire", xyz: [first, between, last] };
  return { action: "draw", kind, xyz };
}
