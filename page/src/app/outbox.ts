// Edits on their way to the server. One that the server could not be told of is kept, in the browser's own storage
// too, and sent again when the server is back; until then the page says how many wait.

import * as api from "./api";
import type { Changed, Edit, Line, Survey } from "./documents";

interface Letter {
  edit: Edit;
  key: string; // an edit whose answer was lost is not made twice
  revision: number; // what the page knew when the person acted
  shape: Line | null; // of a followed line: what to draw if the server has lost the trace
}

export class Outbox {
  private readonly place: string;
  private letters: Letter[];
  private onTheWay = 0;
  private isResending = false;
  private turn: Promise<void> = Promise.resolve(); // one edit after the other
  private own = { from: 0, to: 0 }; // from and to revisions between which all edits were this page's own
  private last: Date | null = null;

  constructor(
    survey: Survey,
    private readonly tells: {
      arrived(changed: Changed): void;
      told(waiting: number, since: Date | null): void;
      held(why: Error): void; // the server is there, and could not save
    },
  ) {
    this.place = `linework unsent ${survey.name} ${survey.lines_file}`;
    this.letters = kept(this.place);
  }

  // Send an edit, after those before it. Throws what the server has against it; null: the edit has to wait.
  async send(edit: Edit, revision: number, shape?: Line): Promise<Changed | null> {
    const letter = { edit, key: crypto.randomUUID(), revision, shape: shape ?? null };
    this.onTheWay += 1;
    this.tell();
    const sending = this.turn.then(() => this.deliver(letter));
    this.turn = sending.then(() => undefined, () => undefined);
    try {
      return await sending;
    } finally {
      this.onTheWay -= 1;
      this.tell();
    }
  }

  // Send what waits, oldest first; returns what the server has against some of them
  async resend(): Promise<Error[]> {
    const problems: Error[] = [];
    if (this.isResending) return problems;
    this.isResending = true;
    for (let letter = this.letters[0]; letter !== undefined; letter = this.letters[0]) {
      try {
        this.receive(letter, await this.again(letter));
      } catch (error) {
        if (isAway(error)) {
          this.later(error);
          break;
        }
        const why = error instanceof Error ? error.message : String(error);
        problems.push(new Error(`An edit that had waited (${letter.edit.action}) could not be saved: ${why}`));
      }
      this.letters.shift();
      this.store();
    }
    this.isResending = false;
    return problems;
  }

  private async deliver(letter: Letter): Promise<Changed | null> {
    if (this.letters.length > 0) return this.hold(letter); // the order of edits is kept
    try {
      return this.receive(letter, await api.change(letter.edit, this.knownTo(letter), letter.key));
    } catch (error) {
      if (!isAway(error)) throw error;
      this.later(error);
      return this.hold(letter);
    }
  }

  private later(error: unknown): void {
    if (error instanceof api.ProblemError && error.status === 503) this.tells.held(error);
  }

  // What the person knew: also the edits of their own that were still on the way when they made this one
  private knownTo({ revision }: Letter): number {
    const { from, to } = this.own;
    return revision >= from && revision <= to ? to : revision;
  }

  // A trace lives as long as the server: if it is gone, the line is saved as it was on the screen
  private async again(letter: Letter): Promise<Changed> {
    const { edit, key, shape } = letter;
    const known = this.knownTo(letter);
    try {
      return await api.change(edit, known, key);
    } catch (error) {
      if (edit.action !== "keep" || shape === null || isAway(error)) throw error;
      const xyz = shape.xyz.slice(edit.first, edit.last + 1);
      return api.change({ action: "draw", kind: shape.kind, xyz }, known, key);
    }
  }

  private receive(letter: Letter, changed: Changed): Changed {
    const { from, to } = this.own;
    const known = this.knownTo(letter);
    // Nobody else's edit lies between: what follows is of the same knowledge
    if (changed.revision === known + 1) this.own = { from: known === to ? from : known, to: changed.revision };
    this.last = new Date();
    this.tells.arrived(changed);
    return changed;
  }

  private hold(letter: Letter): null {
    this.letters.push(letter);
    this.store();
    return null;
  }

  private store(): void {
    if (this.letters.length > 0) localStorage.setItem(this.place, JSON.stringify(this.letters));
    else localStorage.removeItem(this.place);
    this.tell();
  }

  private tell(): void {
    this.tells.told(this.letters.length + this.onTheWay, this.last);
  }
}

// What was kept when the page was closed; what nobody can read is not worth keeping
function kept(place: string): Letter[] {
  try {
    const letters: unknown = JSON.parse(localStorage.getItem(place) ?? "[]");
    return Array.isArray(letters) ? (letters as Letter[]) : [];
  } catch {
    return [];
  }
}

// Nobody answered, or somebody who does not know us: the edit is not refused, it has not arrived
function isAway(error: unknown): boolean {
  return error instanceof api.ProblemError && (error.status === 0 || error.status === 401 || error.status === 503);
}
