// The help: all keys by group, and topics in words; what is typed into its search field is looked for in both.

import "./help.css";

import { element } from "./element";
import { type Keyboard, shownKey } from "./keyboard";

// Keys of single views, which work after a click in them or when they are reached with F6 and Tab
const IN_VIEWS: [group: string, keys: string[], title: string][] = [
  ["In the section", ["ArrowUp", "ArrowDown"], "Step by 0.5 m along the line"],
  ["In the section", ["PageUp", "PageDown"], "Step by 5 m"],
  ["In the section", ["ArrowLeft", "ArrowRight"], "Previous and next vertex"],
  ["In the straightened view", ["ArrowLeft", "ArrowRight"], "Previous and next node"],
  ["In the straightened view", ["Shift+ArrowUp", "Shift+ArrowDown"], "Move the node 1 cm to the left or right"],
  ["In the straightened view", ["Shift+ArrowLeft", "Shift+ArrowRight"], "Move the node 1 cm back or on"],
  ["In the straightened view", ["Alt+ArrowUp", "Alt+ArrowDown"], "Move the node 1 cm up or down"],
  ["In the straightened view", ["Enter", "Escape"], "Save or undo the move"],
  ["In the straightened view", ["Delete"], "Remove the node"],
  ["In the straightened view", ["Home", "End"], "To the start, to the end of the line"],
  ["In the stereo view", ["ArrowLeft", "ArrowRight"], "Previous and next pair"],
  ["In the stereo view", ["Shift+p"], "Play the drive"],
  ["In rows of tabs", ["ArrowLeft", "ArrowRight"], "Previous and next view"],
];

const TOPICS: [title: string, text: string][] = [
  ["Review what is unsure", "N goes to the next item of the queue and shows its evidence; A accepts, X rejects, Y takes the proposal, Q dismisses. What is sure comes last, as one item."],
  ["Look over the road", "Stretches of 60 m are items of the queue, those first where most may be wrong or missing. Click a line that is wrong and press X; F and a click follow one that is missing; Q says that the stretch was looked over."],
  ["Mend the same fault elsewhere", "After a line is rejected or deleted, or given another kind or attribute, Alike lists the lines that may have the same fault. Shift N looks at the next, Shift A takes it in or leaves it out, Shift M mends all that are taken in as one edit."],
  ["Follow a line from a click", "F, then click beside the kerb, marking, guardrail or cable. Enter keeps the line, B bridges a gap, C continues with a click farther on."],
  ["Follow several edges at once: templates", "Select a line, for example the foot of a kerb, and press Template in the section view. Click the other edges there - top, back, gutter - and say for each what defines it and of which kind its line is. Saved and chosen beside the Follow tool, the template is followed with each line; Shift T finds it beside the selected line. All its lines are one edit."],
  ["Follow a wire from pole to pole", "Keep or select a cable; Shift W adds the same wire in all spans that the points show, Shift V the wires beside it too, as one edit. They are named by network, circuit and span, and the message says the lowest clearance."],
  ["Follow both rails of a median", "Keep or select a guardrail or a barrier; Shift G adds the other one of its median, up to 3.5 m across, as one edit. What the van drove between is no median."],
  ["Work without a mouse", "F6 goes from part to part of the page. In the plan the arrow keys move the view, and Ctrl Enter clicks in its middle: with Select, Follow, Draw and Measure alike."],
  ["Correct a node", "In the straightened view choose it with Left and Right, move it with Shift or Alt and the arrow keys, and save with Enter; or drag it in the plan, in the section or there."],
  ["Check a line along its length", "Select it and open Straightened: points, heights, accuracy, bridged stretches and images by chainage. Space moves 20 m on."],
  ["See the road as the cameras saw it", "Road image among the backgrounds of the plan: zoom in until it appears. Each pixel is from one image; nothing is shown where none sees the road."],
  ["Undo", "Ctrl Z undoes the last edit, Ctrl Shift Z redoes it. Everything is saved at once; History lists who changed what."],
  ["Measure a kerb, a rail, a clearance", "The table under the section has the heights where lines cross it; the straightened view draws them along the line."],
  ["Bridged stretches", "Dotted in the plan and hatched in the straightened view: nothing was measured there."],
  ["Export and feature codes", "Export writes the lines as they are saved in any format, with layers and codes of your table."],
];

export function helpDialog(keyboard: Keyboard): HTMLDialogElement {
  const body = element("div", { class: "keys", tabindex: 0, "aria-label": "Keys and topics" });
  const found = element("p", { class: "found", role: "status" });
  const search = element("input", {
    type: "search", name: "help", placeholder: "Search: kerb, undo, bridge, Space …", "aria-label": "Search the help", autocomplete: "off",
    input: () => fill(),
  });
  const dialog = element("dialog", { class: "help", "aria-label": "Help" },
    element("header", {}, element("h2", {}, "Help"), search, found, element("button", { type: "button", click: () => dialog.close() }, "Close")),
    body,
  );
  const fill = (): void => {
    const sections = sectionsOf(keyboard, search.value);
    const n = sections.reduce((sum, section) => sum + section.querySelectorAll("dl > div, p").length, 0);
    found.textContent = search.value.trim() === "" ? "" : n === 0 ? "Nothing found" : `${n} found`;
    body.replaceChildren(...sections);
  };
  const showModal = dialog.showModal.bind(dialog);
  // Filled when opened, because panes bind keys after this
  dialog.showModal = () => {
    search.value = "";
    fill();
    showModal();
    search.focus();
  };
  dialog.addEventListener("click", (event) => {
    if (event.target === dialog) dialog.close();
  });
  return dialog;
}

function sectionsOf(keyboard: Keyboard, wanted: string): HTMLElement[] {
  const words = wanted.toLowerCase().split(/\s+/).filter(Boolean);
  const fits = (...texts: string[]): boolean => words.every((word) => texts.join(" ").toLowerCase().includes(word));
  const groups = new Map<string, HTMLElement>();
  const all: [string, string[], string][] = [
    ...keyboard.bindings.map(({ group, keys, title }): [string, string[], string] => [group, keys, title]), ...IN_VIEWS,
  ];
  for (const [group, keys, title] of all) {
    const shown = keys.map(shownKey);
    if (!fits(group, title, ...shown)) continue;
    const list = groups.get(group) ?? element("dl", {});
    groups.set(group, list);
    const labels = shown.flatMap((key, i) => [...(i > 0 ? [" "] : []), element("kbd", {}, key)]);
    list.append(element("div", {}, element("dt", {}, ...labels), element("dd", {}, title)));
  }
  const topics = TOPICS.filter(([title, text]) => fits(title, text));
  return [
    ...topics.map(([title, text]) => element("section", { class: "topic" }, element("h3", {}, title), element("p", {}, text))),
    ...[...groups].map(([title, list]) => element("section", {}, element("h3", {}, title), list)),
  ];
}
