// The bar of controls above a view.

import "./bar.css";

import { button, element } from "./element";

type Choices = readonly (readonly [value: string, text: string])[];

export class Bar {
  readonly element = element("div", { class: "pane-bar" });

  button(text: string, title: string, pressed: () => void): HTMLButtonElement {
    const made = button(title, text, pressed);
    this.element.append(made);
    return made;
  }

  choice(title: string, choices: Choices, chosen: (value: string) => void): HTMLSelectElement {
    const select = element("select", { title, "aria-label": title });
    fill(select, choices);
    select.addEventListener("change", () => chosen(select.value));
    this.element.append(select);
    return select;
  }

  // A number with its unit; what is outside the limits is brought back to them
  number(
    text: string, title: string, unit: string, limits: { value: number; least: number; most: number; step: number },
    changed: (value: number) => void,
  ): HTMLInputElement {
    const { value, least, most, step } = limits;
    const input = element("input", { type: "number", min: least, max: most, step, value, "aria-label": title });
    input.addEventListener("change", () => {
      const wanted = Number.isFinite(input.valueAsNumber) ? input.valueAsNumber : value;
      const inside = Math.min(most, Math.max(least, wanted));
      input.value = String(inside);
      changed(inside);
    });
    this.element.append(element("label", { title }, text, input, unit));
    return input;
  }

  tick(text: string, title: string, changed: (value: boolean) => void): HTMLInputElement {
    const input = element("input", { type: "checkbox" });
    input.addEventListener("change", () => changed(input.checked));
    this.element.append(element("label", { title }, input, text));
    return input;
  }

  // A place for words that change; it takes what room is left, so that they do not push the controls about
  words(): HTMLElement {
    const words = element("span", { class: "pane-words" });
    this.element.append(words);
    return words;
  }
}

export function fill(select: HTMLSelectElement, choices: Choices): void {
  select.replaceChildren(...choices.map(([value, text]) => element("option", { value }, text)));
}
