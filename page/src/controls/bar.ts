// The row of controls above a view.

import "./bar.css";

import { button, element } from "./element";

type Choices = readonly (readonly [value: string, text: string])[];

export class Bar {
  readonly element = element("div", { class: "pane-bar" });

  button(text: string, title: string, run: () => void): HTMLButtonElement {
    const made = button(title, text, run);
    this.element.append(made);
    return made;
  }

  choice(title: string, choices: Choices, choose: (value: string) => void): HTMLSelectElement {
    const select = element("select", { title, "aria-label": title });
    fill(select, choices);
    select.addEventListener("change", () => choose(select.value));
    this.element.append(select);
    return select;
  }

  // A number with its unit, clamped to its limits
  number(
    text: string, title: string, unit: string, limits: { value: number; min: number; max: number; step: number },
    change: (value: number) => void,
  ): HTMLInputElement {
    const { value, min, max, step } = limits;
    const input = element("input", { type: "number", min, max, step, value, "aria-label": title });
    input.addEventListener("change", () => {
      const entered = Number.isFinite(input.valueAsNumber) ? input.valueAsNumber : value;
      const clamped = Math.min(max, Math.max(min, entered));
      input.value = String(clamped);
      change(clamped);
    });
    this.element.append(element("label", { title }, text, input, unit));
    return input;
  }

  checkbox(text: string, title: string, change: (value: boolean) => void): HTMLInputElement {
    const input = element("input", { type: "checkbox" });
    input.addEventListener("change", () => change(input.checked));
    this.element.append(element("label", { title }, input, text));
    return input;
  }

  // A status text that takes the remaining width, so that it does not push the controls around
  status(): HTMLElement {
    const text = element("span", { class: "pane-words" });
    this.element.append(text);
    return text;
  }
}

export function fill(select: HTMLSelectElement, choices: Choices): void {
  select.replaceChildren(...choices.map(([value, text]) => element("option", { value }, text)));
}
