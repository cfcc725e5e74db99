// The state that all panes share - the survey, its lines, the selection, the tool - and the events that announce changes.

import * as api from "./api";
import { Keyboard } from "../controls/keyboard";
import type { Changed, Edit, FollowMessage, Job, Line, Place, QueueItem, Survey } from "./documents";
import { type Limits, LineFilter } from "./filter";
import { Following, type Growth } from "./following";
import { Outbox } from "./outbox";
import { TemplateBook } from "./templates";

export interface Events {
  lines: { changed: Line[]; removed: string[] }; // lines were added, changed or removed
  selection: string[]; // ids of the selected lines
  filter: Limits; // other lines are shown
  reverted: Line[]; // lines that an undo or redo brought back
  item: QueueItem | null; // the queue looks at it
  edited: { edit: Edit; number: number }; // this page saved an edit
  look: { at: Place; by: string }; // a pane (its name) moved to a place: the others follow
  cursor: { at: Place; by: string } | null; // the mouse, in world coordinates
  tool: Tool;
  message: { text: string; kind: "info" | "problem"; place?: Place };
  undo: { can_undo: boolean; can_redo: boolean };
  connected: boolean;
  job: Job;
  tiles: { done: number; total: number }; // image tiles the server has rendered ahead
  pair: number; // the stereo pair on show
  followMessage: FollowMessage; // every message about the followed line
  growth: Growth; // the line being followed
  saved: { waiting: number; since: Date | null }; // edits not yet confirmed by the server; time of the last save
}

// select: a click selects; follow: a click follows a line; draw: clicks are vertices; measure: clicks are a path
export type Tool = "select" | "follow" | "draw" | "measure";

type Listener<K extends keyof Events> = (value: Events[K]) => void;

const FROM_IMAGES = /_stereo$/; // kinds of lines extracted from images alone
const RETRY_MS = 3000; // pause before resending an edit that the server could not save

export class App {
  readonly lines = new Map<string, Line>();
  revision = 0;
  selection: string[] = [];
  tool: Tool = "select";
  followKind = ""; // "": the server chooses by the place
  readonly keyboard = new Keyboard();
  readonly templates = new TemplateBook();
  readonly filter = new LineFilter(() => this.emit("filter", this.filter.now));
  readonly following: Following;
  private readonly outbox: Outbox;
  private readonly listeners = new Map<keyof Events, Set<(value: never) => void>>();

  constructor(readonly survey: Survey) {
    this.following = new Following({
      kind: () => this.followKind,
      template: () => this.templates.chosen,
      save: (edit, shape) => this.submit(edit, shape),
      select: (ids) => this.select(ids),
      received: (message) => this.emit("followMessage", message),
      changed: (growth) => this.emit("growth", growth),
      problem: (error) => this.reportProblem(error),
    });
    this.outbox = new Outbox(survey, {
      saved: (changed) => this.apply(changed),
      progress: (waiting, since) => this.emit("saved", { waiting, since }),
      // The connection stays open when the server is busy, so no reconnection will resend the edit
      unavailable: (error) => {
        this.reportProblem(error);
        window.setTimeout(() => void this.reconnected().catch((why: unknown) => this.reportProblem(why)), RETRY_MS);
      },
    });
  }

  // Show only the lines of some kinds; null: of all
  showOnly(kinds: string[] | null): void {
    const all = this.kinds();
    this.filter.only(kinds ?? all, all);
  }

  // The kinds that linework knows, then others that lines have
  kinds(): string[] {
    return [...new Set([...this.survey.kinds.map(({ kind }) => kind), ...[...this.lines.values()].map(({ kind }) => kind)])];
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
        reportError(error); // an error in one pane must not stop the others
      }
    }
  }

  colour(kind: string): string {
    const plain = kind.replace(FROM_IMAGES, "");
    return this.survey.kinds.find((known) => known.kind === plain)?.colour ?? "#787878";
  }

  // The name of a kind as the user reads it
  title(kind: string): string {
    const plain = kind.replace(FROM_IMAGES, "");
    const title = this.survey.kinds.find((known) => known.kind === plain)?.title ?? plain;
    return plain === kind ? title : `${title} (images)`;
  }

  select(ids: string[]): void {
    this.selection = ids.filter((id) => this.lines.has(id));
    this.emit("selection", this.selection);
  }

  // Save an edit; returns null if it was refused or is waiting for the server. Every edit of the page goes through here.
  // `shape` is the line as it looks on the page, in case the server loses its trace.
  async change(edit: Edit, shape?: Line): Promise<Changed | null> {
    const changed = await this.submit(edit, shape);
    if (changed !== null && changed !== "refused") this.emit("edited", { edit, number: changed.number });
    return changed === "refused" ? null : changed;
  }

  // As `change`, but telling a refusal from a wait (null)
  async submit(edit: Edit, shape?: Line): Promise<Changed | null | "refused"> {
    try {
      return await this.outbox.send(edit, this.revision, shape);
    } catch (error) {
      this.reportProblem(error);
      return "refused";
    }
  }

  // The connection is open (again): send the waiting edits, then fetch what was missed
  async reconnected(): Promise<void> {
    const problems = await this.outbox.resend();
    await this.reload();
    for (const problem of problems) this.reportProblem(problem);
  }

  async undo(): Promise<void> {
    await this.revert(api.undo);
  }

  async redo(): Promise<void> {
    await this.revert(api.redo);
  }

  // Undo or redo, then select the lines it touched, and show them if none of them is in view
  private async revert(request: () => Promise<Changed>): Promise<void> {
    try {
      const changed = await request();
      await this.apply(changed);
      this.select(changed.lines.map(({ id }) => id));
      if (changed.lines.length > 0) this.emit("reverted", changed.lines);
    } catch (error) {
      this.reportProblem(error);
    }
  }

  // Once it is done the page has these lines, also where a message was missed
  async apply(changed: Changed): Promise<void> {
    if (changed.revision <= this.revision) return; // the page's own edits arrive twice: as the answer, and live
    if (changed.revision > this.revision + 1)
      return this.reload().catch((error: unknown) => this.reportProblem(error)); // a message was missed
    this.revision = changed.revision;
    for (const id of changed.removed) this.lines.delete(id);
    for (const line of changed.lines) this.lines.set(line.id, line);
    this.emit("lines", { changed: changed.lines, removed: changed.removed });
    this.emit("undo", changed);
    this.select(this.selection);
  }

  // Fetch what has changed since the page's revision; at first, everything
  async reload(): Promise<void> {
    const since = this.revision;
    let all = await api.lines(since);
    let removed = all.removed;
    const isWhole = since === 0 || all.revision < since; // a server that was given another file knows less than the page
    if (isWhole && since > 0) all = await api.lines();
    if (this.revision > since && all.revision < this.revision) return this.reload(); // older than what came meanwhile
    if (isWhole) {
      const present = new Set(all.lines.map(({ id }) => id));
      removed = [...this.lines.keys()].filter((id) => !present.has(id));
    }
    for (const id of removed) this.lines.delete(id);
    for (const line of all.lines) this.lines.set(line.id, line);
    this.revision = all.revision;
    this.emit("lines", { changed: all.lines, removed });
    this.emit("undo", all);
    this.select(this.selection);
  }

  reportProblem(error: unknown): void {
    this.emit("message", { text: error instanceof Error ? error.message : String(error), kind: "problem" });
  }
}
