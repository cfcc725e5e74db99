// Edits on their way to the server. One that the server could not be told of is kept, in the browser's own storage
// too, and sent again when the server is back; until then the page says how many wait.

import * as api from "./api";
import type { Changed, Edit, Line, Survey } from "./types";

interface Letter {
  edit: Edit;
  revision: number; // what the page knew when the person acted
  shape: Line | null; // of a followed line: what to draw if the server has lost the trace
}

export class Outbox {
  private readonly place: string;
  private letters: Letter[];
  private onTheWay = 0;
  private last: Date | null = null;

  constructor(
    survey: Survey,
    private readonly arrived: (changed: Changed) => void,
    private readonly told: (waiting: number, since: Date | null) => void,
  ) {
    this.place = `linework unsent ${survey.name} ${survey.lines_file}`;
    this.letters = JSON.parse(localStorage.getItem(this.place) ?? "[]") as Letter[];
  }

  // Send an edit. Throws what the server has against it, and null comes back where the edit has to wait.
  async send(edit: Edit, revision: number, shape?: Line): Promise<Changed | null> {
    const letter = { edit, revision, shape: shape ?? null };
    if (this.letters.length > 0) return this.hold(letter); // the order of edits is kept
    this.onTheWay += 1;
    this.tell();
    try {
      return this.receive(await api.change(edit, revision));
    } catch (error) {
      if (!isAway(error)) throw error;
      return this.hold(letter);
    } finally {
      this.onTheWay -= 1;
      this.tell();
    }
  }

  // Send what waits, oldest first; returns what the server has against some of them
  async resend(): Promise<Error[]> {
    const problems: Error[] = [];
    for (let letter = this.letters[0]; letter !== undefined; letter = this.letters[0]) {
      try {
        this.receive(await this.again(letter));
      } catch (error) {
        if (isAway(error)) break;
        const why = error instanceof Error ? error.message : String(error);
        problems.push(new Error(`An edit that had waited (${letter.edit.action}) could not be saved: ${why}`));
      }
      this.letters.shift();
      this.store();
    }
    return problems;
  }

  // A trace lives as long as the server: if it is gone, the line is saved as it was on the screen
  private async again({ edit, revision, shape }: Letter): Promise<Changed> {
    try {
      return await api.change(edit, revision);
    } catch (error) {
      if (edit.action !== "keep" || shape === null || isAway(error)) throw error;
      const xyz = shape.xyz.slice(edit.first, edit.last + 1);
      return api.change({ action: "draw", kind: shape.kind, xyz }, revision);
    }
  }

  private receive(changed: Changed): Changed {
    this.last = new Date();
    this.arrived(changed);
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
    this.told(this.letters.length + this.onTheWay, this.last);
  }
}

// Nobody answered, or somebody who does not know us: the edit is not refused, it has not arrived
function isAway(error: unknown): boolean {
  return error instanceof api.ProblemError && (error.status === 0 || error.status === 401 || error.status === 503);
}
