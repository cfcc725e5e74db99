// The help: all keys, by what they are for, from the same table that runs them.

import { element } from "./element";
import { type Keyboard, shownKey } from "./keyboard";

export function helpDialog(keyboard: Keyboard): HTMLDialogElement {
  const body = element("div", { class: "keys" });
  const dialog = element("dialog", { class: "help", "aria-label": "Keys" },
    element("header", {}, element("h2", {}, "Keys"), element("button", { type: "button", click: () => dialog.close() }, "Close")),
    body,
  );
  const showModal = dialog.showModal.bind(dialog);
  // Made when it is asked for: panes bind keys after this
  dialog.showModal = () => {
    body.replaceChildren(...groupsOf(keyboard));
    showModal();
  };
  dialog.addEventListener("click", (event) => {
    if (event.target === dialog) dialog.close();
  });
  return dialog;
}

function groupsOf(keyboard: Keyboard): HTMLElement[] {
  const groups = new Map<string, HTMLElement>();
  for (const { keys, title, group } of keyboard.bindings) {
    const list = groups.get(group) ?? element("dl", {});
    groups.set(group, list);
    const shown = keys.flatMap((key, i) => [...(i > 0 ? [" "] : []), element("kbd", {}, shownKey(key))]);
    list.append(element("div", {}, element("dt", {}, ...shown), element("dd", {}, title)));
  }
  return [...groups].map(([title, list]) => element("section", {}, element("h3", {}, title), list));
}
