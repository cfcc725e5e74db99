// The commands for the selected lines, and their keys.

import type { App } from "../app/app";
import type { Edit, Place } from "../app/documents";
import { REJECTED } from "../app/filter";
import type { VertexEditing } from "./vertex-editing";

export interface Command {
  title: string;
  key: string;
  can: () => boolean;
  run: () => void;
}

export function lineCommands(app: App, editing: VertexEditing, cursor: () => Place | null): Command[] {
  const ids = () => app.selection;
  const one = () => (ids().length === 1 ? app.lines.get(ids()[0] ?? "") ?? null : null);
  const some = () => ids().length > 0;
  const isRejected = () => some() && ids().every((id) => app.lines.get(id)?.review === REJECTED);
  const onOne = (action: "smooth" | "reverse") => () => {
    const line = one();
    if (line) void app.change({ action, id: line.id });
  };
  return [
    { title: "Split", key: "t", can: () => one() !== null, run: () => split(app, editing, cursor()) },
    { title: "Join", key: "j", can: () => ids().length === 2, run: () => void join(app) },
    { title: "Smooth", key: "Shift+s", can: () => one() !== null, run: onOne("smooth") },
    { title: "Reverse", key: "r", can: () => one() !== null, run: onOne("reverse") },
    { title: "Parallel", key: "Shift+p", can: () => one() !== null, run: () => void drawParallel(app, cursor()) },
    { title: "From here", key: "Shift+o", can: () => one() !== null, run: () => startParallel(app, cursor()) },
    { title: "Template", key: "Shift+t", can: () => one() !== null, run: () => void addTemplate(app) },
    { title: "Wire", key: "Shift+w", can: () => one()?.kind === "cable", run: () => void addWires(app, "own") },
    { title: "Wires", key: "Shift+v", can: () => one()?.kind === "cable", run: () => void addWires(app, "all") },
    { title: "Other rail", key: "Shift+g", can: () => standsOnMedian(one()?.kind), run: () => void addPartner(app) },
    {
      title: "Dashes", key: "Shift+d", can: () => some() && ids().every((id) => app.lines.get(id)?.kind === "lane_marking"),
      run: () => void app.change({ action: "dashes", ids: ids() }),
    },
    { title: "Continue", key: "c", can: () => one() !== null, run: () => continueLine(app, editing, cursor()) },
    {
      title: "Restore", key: "Shift+x", can: isRejected,
      run: () => void app.change({ action: "restore", ids: ids() }),
    },
    {
      title: "Delete", key: "Delete", can: some,
      run: () => {
        if (!editing.removeActive()) void app.change({ action: "delete", ids: ids() });
      },
    },
  ];
}

export function bindCommands(app: App, commands: Command[]): void {
  for (const { title, key, can, run } of commands)
    app.keyboard.bind({ keys: [key], title: titles[title] ?? title, group: "Edit the selected line", when: can, run });
  const group = "Edit the selected line";
  app.keyboard.bind({ keys: ["Ctrl+z"], title: "Undo", group, run: () => void app.undo() });
  app.keyboard.bind({ keys: ["Ctrl+Shift+z", "Ctrl+y"], title: "Redo", group, run: () => void app.redo() });
}

const titles: Record<string, string> = {
  Split: "Split at the active vertex, or at the mouse",
  Join: "Join the two selected lines",
  Delete: "Remove the active vertex or, without one, delete the lines",
  Continue: "Continue from the nearer end: click farther along",
  Restore: "Restore rejected lines",
  Parallel: "New line parallel to the selected one, through the mouse",
  "From here": "Start the parallel line at the mouse; Parallel then ends it",
  Dashes: "Add missing dashes",
  Wire: "The same wire from pole to pole",
  Wires: "The same wire from pole to pole, and those beside it",
  "Other rail": "The other rail or barrier of the median",
  Template: "Lines of the template beside the selected one",
};

function split(app: App, editing: VertexEditing, cursor: Place | null): void {
  const line = app.lines.get(app.selection[0] ?? "");
  const vertex = editing.active === null ? undefined : line?.xyz[editing.active];
  const at: Place | null = vertex ? [vertex[0], vertex[1]] : cursor;
  if (line && at) void changeAndSelect(app, { action: "split", id: line.id, at });
  else app.emit("message", { text: "Move the mouse to where the line is to be split, or click a vertex.", kind: "info" });
}

async function join(app: App): Promise<void> {
  const [first, second] = app.selection;
  if (first === undefined || second === undefined) return;
  await changeAndSelect(app, { action: "join", ids: [first, second] });
}

// Save an edit, then select the lines it made
async function changeAndSelect(app: App, edit: Edit): Promise<void> {
  const changed = await app.change(edit);
  if (changed) app.select(changed.lines.map((line) => line.id));
}

function continueLine(app: App, editing: VertexEditing, cursor: Place | null): void {
  const line = app.lines.get(app.selection[0] ?? "");
  const [first, last] = [line?.xyz[0], line?.xyz.at(-1)];
  if (!line || !first || !last) return;
  const near = ([east, north]: readonly number[]) =>
    cursor === null ? 0 : Math.hypot((east ?? 0) - cursor[0], (north ?? 0) - cursor[1]);
  const atStart = editing.active === null ? near(first) < near(last) : editing.active === 0;
  app.followKind = line.kind;
  app.setTool("follow");
  app.following.continueFrom(atStart ? "start" : "end", line.id);
}

// Where the next parallel line starts, and the line it belongs to
let parallelStart: { id: string; at: Place } | null = null;

function startParallel(app: App, cursor: Place | null): void {
  const [id] = app.selection;
  parallelStart = id !== undefined && cursor ? { id, at: cursor } : null;
  const text = parallelStart ? "Now move the mouse to where the new line ends and press Shift P." : "Move the mouse to where the new line starts.";
  app.emit("message", { text, kind: "info" });
}

async function drawParallel(app: App, cursor: Place | null): Promise<void> {
  const line = app.lines.get(app.selection[0] ?? "");
  if (!line || !cursor)
    return app.emit("message", { text: "Move the mouse to where the new line is to run and press Shift P.", kind: "info" });
  const at: [Place] | [Place, Place] = parallelStart?.id === line.id ? [parallelStart.at, cursor] : [cursor];
  parallelStart = null;
  const changed = await app.change({ action: "beside", id: line.id, kind: line.kind, at });
  if (changed) app.select(changed.lines.map(({ id }) => id));
}

// The chosen template, or the only one
async function addTemplate(app: App): Promise<void> {
  const [id] = app.selection;
  const { all, chosen } = app.templates;
  const template = chosen || (all.length === 1 ? all[0]!.name : "");
  if (id === undefined) return;
  if (template === "") {
    const text = all.length === 0 ? "Make a template first: Template in the section view." : "Choose the template beside the Follow tool.";
    return app.emit("message", { text, kind: "info" });
  }
  const changed = await app.change({ action: "template", id, template });
  if (changed) app.emit("message", { text: `${changed.lines.length} ${changed.lines.length === 1 ? "line" : "lines"} of ${template} added.`, kind: "info" });
}

function standsOnMedian(kind: string | undefined): boolean {
  return kind === "guardrail" || kind === "barrier";
}

// The rail or barrier that shares a median with the selected one
async function addPartner(app: App): Promise<void> {
  const [id] = app.selection;
  if (id === undefined) return;
  app.emit("message", { text: "Looking for the other rail of the median …", kind: "info" });
  const changed = await app.change({ action: "partner", id });
  if (!changed) return;
  const length_m = changed.lines.reduce((sum, line) => sum + line.length_m, 0);
  app.select([...new Set([id, ...changed.lines.map((line) => line.id)])]);
  app.emit("message", { text: `The other rail: ${length_m.toFixed(0)} m added.`, kind: "info" });
}

// The wires that hang with the selected one: its own conductor, or all
async function addWires(app: App, which: "own" | "all"): Promise<void> {
  const [id] = app.selection;
  if (id === undefined) return;
  app.emit("message", { text: "Following the wire from pole to pole …", kind: "info" });
  const changed = await app.change({ action: "wires", id, which });
  if (!changed) return;
  const clearances = changed.lines.flatMap(({ clearance_m }) => (clearance_m === null ? [] : [clearance_m]));
  const lowest = clearances.length > 0 ? `; lowest clearance ${Math.min(...clearances).toFixed(2)} m` : "";
  app.select([...new Set([id, ...changed.lines.map((line) => line.id)])]);
  app.emit("message", { text: `${changed.lines.length} ${changed.lines.length === 1 ? "wire" : "wires"} added or named${lowest}.`, kind: "info" });
}
