// Light or dark: as the machine says, until the person says otherwise.

type Theme = "light" | "dark";

const KEPT = "linework theme";
const dark = matchMedia("(prefers-color-scheme: dark)");

export function theme(): Theme {
  const kept = localStorage.getItem(KEPT);
  return kept === "light" || kept === "dark" ? kept : dark.matches ? "dark" : "light";
}

// Set it on the page, now and whenever the machine changes its mind; `changed` is told
export function applyTheme(changed: () => void): void {
  const apply = () => {
    document.documentElement.dataset.theme = theme();
    changed();
  };
  dark.addEventListener("change", apply);
  window.addEventListener("linework-theme", apply);
  apply();
}

export function switchTheme(): void {
  localStorage.setItem(KEPT, theme() === "dark" ? "light" : "dark");
  window.dispatchEvent(new Event("linework-theme"));
}
