// Creates elements. Text is always inserted as text: nothing from a file or the server is parsed as markup.

type Child = Node | string;
type Attributes = Record<string, string | number | boolean | EventListener>;

// `element("button", { class: "tool", "aria-label": "Undo", click: () => ... }, "Undo")`
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K, attributes: Attributes = {}, ...children: Child[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name, value);
    else if (typeof value === "boolean") made.toggleAttribute(name, value);
    else made.setAttribute(name, String(value));
  }
  made.append(...children);
  return made;
}

export function button(title: string, label: string, click: () => void, attributes: Attributes = {}): HTMLButtonElement {
  return element("button", { type: "button", title, "aria-label": title, ...attributes, click }, label);
}
