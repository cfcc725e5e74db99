// What all panes share: the survey, the lines, what is selected, where one looks, and who is told of changes.

import * as api from "./api";
import { Following, type Growth } from "./following";
import { Keyboard } from "../controls/keyboard";
import type { Changed, Edit, FollowNews, FollowOrder, Line, Place, Survey } from "./documents";
import { Outbox } from "./outbox";

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
  job: import("./documents").Job;
  pictures: { done: number; total: number }; // tiles made ahead
  pair: number; // the stereo pair that is shown
  order: FollowOrder; // a pane asks the one follower of the page (plan and images alike) for something
  follow: FollowNews; // everything the follower hears, as it comes
  growth: Growth; // the same line as `growing`, with its state, why it stopped and what can be done
  saved: { waiting: number; since: Date | null }; // edits that the server has not answered; when the last was saved
}

// select: click selects; follow: click follows a line; draw: clicks are vertices; measure
export type Tool = "select" | "follow" | "draw" | "measure";

type Listener<K extends keyof Events> = (value: Events[K]) => void;

const AS_SEEN_IN_IMAGES = /_stereo$/;
const AGAIN_MS = 3000; // what the server could not save is sent again after so long

export class App {
  readonly lines = new Map<string, Line>();
  revision = 0;
  selection: string[] = [];
  tool: Tool = "select";
  followKind = ""; // "": the nearest decides
  readonly keyboard = new Keyboard();
  readonly following: Following;
  private readonly outbox: Outbox;
  private readonly listeners = new Map<keyof Events, Set<(value: never) => void>>();

  constructor(readonly survey: Survey) {
    this.following = new Following(this);
    this.outbox = new Outbox(survey, {
      arrived: (changed) => this.take(changed),
      told: (waiting, since) => this.emit("saved", { waiting, since }),
      // The server says that it cannot just now, and the connection stays: nobody else would send it again
      held: (why) => {
        this.problem(why);
        window.setTimeout(() => void this.reconnected().catch((error: unknown) => this.problem(error)), AGAIN_MS);
      },
    });
  }

  setTool(tool: Tool): void {
    this.tool = tool;
    this.emit("tool", tool);
  }

  on<K extends keyof Events>(event: K, listener: Listener<K>): void {
    const all = this.listeners.get(event) ?? new Set();
    all.add(listener as (value: never) => void);
    this.listeners.set(event, all);
  }

  emit<K extends keyof Events>(event: K, value: Events[K]): void {
    for (const listener of this.listeners.get(event) ?? []) {
      try {
        (listener as Listener<K>)(value);
      } catch (error) {
        reportError(error); // a fault of one pane leaves the others working
      }
    }
  }

  colour(kind: string): string {
    const plain = kind.replace(AS_SEEN_IN_IMAGES, "");
    return this.survey.kinds.find((known) => known.kind === plain)?.colour ?? "#787878";
  }

  // What people call a kind; lines as images alone saw them have kinds of their own
  title(kind: string): string {
    const plain = kind.replace(AS_SEEN_IN_IMAGES, "");
    const title = this.survey.kinds.find((known) => known.kind === plain)?.title ?? plain;
    return plain === kind ? title : `${title}, in images`;
  }

  select(ids: string[]): void {
    this.selection = ids.filter((id) => this.lines.has(id));
    this.emit("selection", this.selection);
  }

  // Everything a person does to lines goes through here; the result comes back to all panes. An edit that cannot be
  // sent is kept and sent when the server is back; `shape`: the line as it looks here, for when a trace is lost.
  async change(edit: Edit, shape?: Line): Promise<Changed | null> {
    const changed = await this.tried(edit, shape);
    return changed === "refused" ? null : changed;
  }

  // The same, for those who have something to lose when it is refused; null: it waits
  async tried(edit: Edit, shape?: Line): Promise<Changed | null | "refused"> {
    try {
      return await this.outbox.send(edit, this.revision, shape);
    } catch (error) {
      this.problem(error);
      return "refused";
    }
  }

  // The server is there (again): what waited is sent, then what was missed is asked for
  async reconnected(): Promise<void> {
    const problems = await this.outbox.resend();
    await this.reload();
    for (const problem of problems) this.problem(problem);
  }

  async undo(): Promise<void> {
    await this.wound(api.undo);
  }

  async redo(): Promise<void> {
    await this.wound(api.redo);
  }

  // What was undone or done again is selected, and looked at
  private async wound(ask: () => Promise<Changed>): Promise<void> {
    try {
      const changed = await ask();
      this.take(changed);
      this.select(changed.lines.map(({ id }) => id));
      const [east, north] = changed.lines[0]?.xyz[0] ?? [];
      if (east !== undefined && north !== undefined) this.emit("look", { at: [east, north], by: "undo" });
    } catch (error) {
      this.problem(error);
    }
  }

  take(changed: Changed): void {
    if (changed.revision <= this.revision) return; // our own change comes twice: as the answer, and live
    if (changed.revision > this.revision + 1)
      return void this.reload().catch((error: unknown) => this.problem(error)); // something was missed
    this.revision = changed.revision;
    for (const id of changed.removed) this.lines.delete(id);
    for (const line of changed.lines) this.lines.set(line.id, line);
    this.emit("lines", { changed: changed.lines, removed: changed.removed });
    this.emit("undo", changed);
    this.select(this.selection);
  }

  // Ask for what has happened since; at the beginning for everything
  async reload(): Promise<void> {
    let all = await api.lines(this.revision);
    let removed = all.removed;
    if (this.revision === 0 || all.revision < this.revision) {
      all = this.revision === 0 ? all : await api.lines();
      const there = new Set(all.lines.map(({ id }) => id));
      removed = [...this.lines.keys()].filter((id) => !there.has(id));
    }
    for (const id of removed) this.lines.delete(id);
    for (const line of all.lines) this.lines.set(line.id, line);
    this.revision = all.revision;
    this.emit("lines", { changed: all.lines, removed });
    this.emit("undo", all);
    this.select(this.selection);
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
