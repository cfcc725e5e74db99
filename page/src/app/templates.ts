// The survey's templates of cross-sections: named nodes beside a line, each with the edge that defines it. The chosen one
// is followed with the next line, or found beside the selected one.

import * as api from "./api";
import type { Template } from "./documents";

// What defines a node, as the user reads it
export const EDGES = [
  ["foot", "Foot of a step"], ["top", "Top of a step"], ["break", "Break of slope"], ["shade", "Change of brightness"],
  ["stripe", "Painted stripe"], ["rail", "Upper edge of a rail"], ["wire", "Wire"], ["fixed", "Fixed distance"],
] as const;

export class TemplateBook {
  all: Template[] = [];
  chosen = ""; // name; "": none
  private readonly listeners: (() => void)[] = [];

  onChange(listener: () => void): void {
    this.listeners.push(listener);
  }

  async load(): Promise<void> {
    this.take((await api.templates()).templates);
  }

  // Save one under its name, replacing one of the same name, and choose it
  async save(template: Template): Promise<void> {
    this.take((await api.saveTemplate(template)).templates);
    this.choose(template.name);
  }

  async remove(name: string): Promise<void> {
    this.take((await api.removeTemplate(name)).templates);
  }

  choose(name: string): void {
    this.chosen = name;
    this.changed();
  }

  private take(all: Template[]): void {
    this.all = all;
    if (!all.some(({ name }) => name === this.chosen)) this.chosen = "";
    this.changed();
  }

  private changed(): void {
    for (const listener of this.listeners) listener();
  }
}
