// A button with the key that does the same.

import { element } from "./element";
import { shownKey } from "./keyboard";

export function keyButton(
  key: string, title: string, click: () => void, attributes: Record<string, string | boolean> = {},
): HTMLButtonElement {
  return element(
    "button", { type: "button", ...attributes, click }, element("span", {}, title), element("kbd", {}, shownKey(key).replace("Shift ", "⇧")),
  );
}
