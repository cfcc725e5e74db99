// What all panes share: the survey, the lines, what is selected, where one looks, and who is told of changes.

import * as api from "./api";
import type { Changed, Edit, FollowNews, FollowOrder, Line, Place, Survey } from "./types";

export interface Events {
  lines: { changed: Line[]; removed: string[] }; // lines came, changed or went
  selection: string[]; // ids of the selected lines
  look: { at: Place; by: string }; // somebody (a pane's name) looks at a place: others follow
  cursor: { at: Place; by: string } | null; // where the mouse is
  growing: { lines: Line[]; area: Place[]; pair?: number }; // the line that is being followed; empty lines: none
  tool: Tool;
  message: { text: string; kind: "info" | "problem"; place?: Place };
  undo: { can_undo: boolean; can_redo: boolean };
  connected: boolean;
  job: import("./types").Job;
  pair: number; // the stereo pair that is shown
  order: FollowOrder; // a pane asks the one follower of the page (plan and images alike) for something
  follow: FollowNews; // everything the follower hears, as it comes
}

// select: click selects; follow: click follows a line; draw: clicks are vertices; measure
export type Tool = "select" | "follow" | "draw" | "measure";

type Listener<K extends keyof Events> = (value: Events[K]) => void;

export class App {
  readonly lines = new Map<string, Line>();
  revision = 0;
  selection: string[] = [];
  tool: Tool = "select";
  followKind = ""; // "": the nearest decides
  private readonly listeners = new Map<keyof Events, Set<(value: never) => void>>();

  constructor(readonly survey: Survey) {}

  on<K extends keyof Events>(event: K, listener: Listener<K>): void {
    const all = this.listeners.get(event) ?? new Set();
    all.add(listener as (value: never) => void);
    this.listeners.set(event, all);
  }

  emit<K extends keyof Events>(event: K, value: Events[K]): void {
    for (const listener of this.listeners.get(event) ?? []) (listener as Listener<K>)(value);
  }

  colour(kind: string): string {
    const plain = kind.replace(/_stereo$/, "");
    return this.survey.kinds.find((known) => known.kind === plain)?.colour ?? "#787878";
  }

  select(ids: string[]): void {
    this.selection = ids.filter((id) => this.lines.has(id));
    this.emit("selection", this.selection);
  }

  // Everything a person does to lines goes through here; the result comes back to all panes
  async change(edit: Edit): Promise<Changed | null> {
    try {
      const changed = await api.change(edit, this.revision);
      this.take(changed);
      return changed;
    } catch (error) {
      this.problem(error);
      return null;
    }
  }

  async undo(): Promise<void> {
    await api.undo().then((changed) => this.take(changed), (error) => this.problem(error));
  }

  async redo(): Promise<void> {
    await api.redo().then((changed) => this.take(changed), (error) => this.problem(error));
  }

  take(changed: Changed): void {
    if (changed.revision <= this.revision) return; // our own change comes twice: as the answer, and live
    this.revision = changed.revision;
    for (const id of changed.removed) this.lines.delete(id);
    for (const line of changed.lines) this.lines.set(line.id, line);
    this.emit("lines", { changed: changed.lines, removed: changed.removed });
    this.emit("undo", changed);
    this.select(this.selection);
  }

  async reload(): Promise<void> {
    const all = await api.lines();
    const removed = [...this.lines.keys()].filter((id) => !all.lines.some((line) => line.id === id));
    for (const id of removed) this.lines.delete(id);
    for (const line of all.lines) this.lines.set(line.id, line);
    this.revision = all.revision;
    this.emit("lines", { changed: all.lines, removed });
  }

  problem(error: unknown): void {
    this.emit("message", { text: error instanceof Error ? error.message : String(error), kind: "problem" });
  }
}

// A part of the page: made once, put where the layout wants it
export interface Pane {
  readonly element: HTMLElement;
  resized?(): void;
}
