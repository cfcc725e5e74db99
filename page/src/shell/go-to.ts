// The search field: "EAST, NORTH" goes there.

import type { App } from "../app/app";
import { element } from "../controls/element";
import type { Place } from "../app/documents";

// "691000.5, 5335000" or "691000.5 5335000"; with decimal commas: "691000,5; 5335000" or "691000,5 5335000"
export function placeIn(text: string): Place | null {
  const parts = text.trim().split(/\s*[;\s]\s*|,\s+/).filter(Boolean);
  const numbers = (parts.length === 2 ? parts : text.trim().split(",")).map((part) => Number(part.replace(/,$/, "").replace(",", ".")));
  const [east = NaN, north = NaN] = numbers;
  return numbers.length === 2 && Number.isFinite(east) && Number.isFinite(north) ? [east, north] : null;
}

export function goToField(app: App, go: (place: Place) => void): HTMLElement {
  const field = element("input", {
    type: "search", name: "go-to", placeholder: "Go to EAST, NORTH", "aria-label": "Go to EAST, NORTH", size: 20,
    autocomplete: "off",
  });
  app.keyboard.bind({ keys: ["/"], title: "Go to coordinates", group: "Plan", run: () => field.focus() });
  return element("form", {
    class: "go-to",
    submit: (event) => {
      event.preventDefault();
      const place = placeIn(field.value);
      if (place === null)
        return app.emit("message", { text: `“${field.value}” is not two numbers: write EAST, NORTH in metres.`, kind: "problem" });
      go(place);
      field.blur();
    },
  }, field);
}
