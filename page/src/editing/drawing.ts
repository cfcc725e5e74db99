// Drawing a line by hand: clicks are vertices, and the server adds their heights.

import type { App } from "../app/app";
import { ClickPath } from "./click-path";
import type { Edit, Place } from "../app/documents";

export class Drawing {
  readonly path: ClickPath;

  constructor(private readonly app: App) {
    this.path = new ClickPath(app.colour(app.followKind), () => undefined);
    const when = () => app.tool === "draw" && this.path.places.length > 0;
    const group = "Draw";
    app.keyboard.bind({ keys: ["Enter"], title: "Finish the line", group, when, run: () => void this.finish() });
    app.keyboard.bind({ keys: ["Backspace"], title: "Remove the last vertex", group, when, run: () => this.path.removeLast() });
    app.keyboard.bind({ keys: ["Escape"], title: "Discard the line", group, when, run: () => this.path.clear() });
  }

  click(place: Place): void {
    if (this.app.followKind === "")
      return this.app.emit("message", { text: "First choose the kind of line to draw.", kind: "problem", place });
    this.path.recolour(this.app.colour(this.app.followKind));
    this.path.add(place);
  }

  // A double-click finishes the line; its second click has added the last vertex twice
  doubleClick(): void {
    this.path.removeLast();
    void this.finish();
  }

  private async finish(): Promise<void> {
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
