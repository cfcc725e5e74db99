// Which image lies under the lines: a row of buttons.

import { element } from "../controls/element";
import type { Survey } from "../app/documents";

export function imageSwitch(survey: Survey, show: (name: string) => void): HTMLElement {
  const row = element("div", { class: "image-switch", role: "group", "aria-label": "Image under the lines" });
  const choose = (name: string) => {
    show(name);
    for (const each of row.querySelectorAll("button")) each.setAttribute("aria-pressed", String(each.dataset.image === name));
  };
  const choice = (name: string, title: string, unit: string) => element(
    "button", { type: "button", "data-image": name, title: unit ? `${title} [${unit}]` : title, click: () => choose(name) }, title,
  );
  row.append(...survey.images.map(({ name, title, unit }) => choice(name, title, unit)), choice("", "None", ""));
  choose(survey.images[0]?.name ?? "");
  return row;
}
