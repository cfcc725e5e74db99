// What the queue and the history call the server's actions. It stands apart because both show them.

const TITLES: Record<string, string> = {
  keep: "follow",
  beside: "draw parallel",
  template: "add template",
  wire: "draw wire",
  partner: "add the other rail",
  wires: "follow wires",
  dashes: "add dashes",
  kind: "change kind",
  set: "set attribute",
  move: "move vertex",
  insert: "insert vertex",
  remove: "remove vertex",
};

// Actions not listed read well as they are (accept, split, undo). A dismissal is recorded with its key, which says nothing.
export function actionTitle(action: string): string {
  const [name = ""] = action.split(" ");
  return TITLES[name] ?? name;
}
