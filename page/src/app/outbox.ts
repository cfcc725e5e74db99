// Edits on their way to the server. Those that cannot be delivered are kept, also in the browser's local storage, and
// resent in order when the server is back.

import * as api from "./api";
import type { Changed, Edit, Line, Survey } from "./documents";

interface PendingEdit {
  edit: Edit;
  key: string; // idempotency key: an edit whose answer was lost is not saved twice
  revision: number; // what the page had when the user acted
  shape: Line | null; // of a followed line: what to draw if the server has lost the trace
}

export class Outbox {
  private readonly storageKey: string;
  private pending: PendingEdit[];
  private inFlight = 0;
  private isResending = false;
  private queue: Promise<void> = Promise.resolve(); // one edit at a time
  private own = { from: 0, to: 0 }; // every revision in this range is an edit of this page
  private lastSaved: Date | null = null;

  constructor(
    survey: Survey,
    private readonly page: {
      saved(changed: Changed): Promise<void>;
      progress(waiting: number, lastSaved: Date | null): void;
      unavailable(error: Error): void; // the server answers, but cannot save now
    },
  ) {
    this.storageKey = `linework unsent ${survey.name} ${survey.lines_file}`;
    this.pending = storedEdits(this.storageKey);
  }

  // Send an edit after those before it. Throws if the server refuses it; returns null if it has to wait.
  async send(edit: Edit, revision: number, shape?: Line): Promise<Changed | null> {
    const pending = { edit, key: crypto.randomUUID(), revision, shape: shape ?? null };
    this.inFlight += 1;
    this.report();
    const sending = this.queue.then(() => this.deliver(pending));
    this.queue = sending.then(() => undefined, () => undefined);
    try {
      return await sending;
    } finally {
      this.inFlight -= 1;
      this.report();
    }
  }

  // Resend the waiting edits, oldest first; returns the server's refusals
  async resend(): Promise<Error[]> {
    const problems: Error[] = [];
    if (this.isResending) return problems;
    this.isResending = true;
    for (let first = this.pending[0]; first !== undefined; first = this.pending[0]) {
      try {
        await this.accept(first, await this.retry(first));
      } catch (error) {
        if (isUndelivered(error)) {
          this.reportUnavailable(error);
          break;
        }
        const reason = error instanceof Error ? error.message : String(error);
        problems.push(new Error(`A waiting edit (${first.edit.action}) could not be saved: ${reason}`));
      }
      this.pending.shift();
      this.store();
    }
    this.isResending = false;
    return problems;
  }

  private async deliver(pending: PendingEdit): Promise<Changed | null> {
    if (this.pending.length > 0) return this.hold(pending); // edits stay in order
    try {
      return await this.accept(pending, await api.change(pending.edit, this.revisionFor(pending), pending.key));
    } catch (error) {
      if (!isUndelivered(error)) throw error;
      this.reportUnavailable(error);
      return this.hold(pending);
    }
  }

  private reportUnavailable(error: unknown): void {
    if (error instanceof api.ProblemError && error.status === 503) this.page.unavailable(error);
  }

  // The revision the user acted on, including the page's own edits that were still in flight
  private revisionFor({ revision }: PendingEdit): number {
    const { from, to } = this.own;
    return revision >= from && revision <= to ? to : revision;
  }

  // The server forgets traces when it restarts; the line is then drawn as it was on the screen
  private async retry(pending: PendingEdit): Promise<Changed> {
    const { edit, key, shape } = pending;
    const revision = this.revisionFor(pending);
    try {
      return await api.change(edit, revision, key);
    } catch (error) {
      if (edit.action !== "keep" || shape === null || isUndelivered(error)) throw error;
      const xyz = shape.xyz.slice(edit.first, edit.last + 1);
      return api.change({ action: "draw", kind: shape.kind, xyz }, revision, key);
    }
  }

  private async accept(pending: PendingEdit, changed: Changed): Promise<Changed> {
    const { from, to } = this.own;
    const known = this.revisionFor(pending);
    // No edit of another page in between: the range of own revisions grows
    if (changed.revision === known + 1) this.own = { from: known === to ? from : known, to: changed.revision };
    this.lastSaved = new Date();
    await this.page.saved(changed);
    return changed;
  }

  private hold(pending: PendingEdit): null {
    this.pending.push(pending);
    this.store();
    return null;
  }

  private store(): void {
    if (this.pending.length > 0) localStorage.setItem(this.storageKey, JSON.stringify(this.pending));
    else localStorage.removeItem(this.storageKey);
    this.report();
  }

  private report(): void {
    this.page.progress(this.pending.length + this.inFlight, this.lastSaved);
  }
}

// The edits that were waiting when the page was closed; an unreadable list is dropped
function storedEdits(storageKey: string): PendingEdit[] {
  try {
    const edits: unknown = JSON.parse(localStorage.getItem(storageKey) ?? "[]");
    return Array.isArray(edits) ? (edits as PendingEdit[]) : [];
  } catch {
    return [];
  }
}

// No answer (0), an unknown session (401) or a busy server (503): the edit was not refused, it did not arrive
function isUndelivered(error: unknown): boolean {
  return error instanceof api.ProblemError && (error.status === 0 || error.status === 401 || error.status === 503);
}
