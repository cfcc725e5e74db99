// One key, one value, as on the touch-screen in the van. The key stands on the button.

export const KIND_KEYS = ["1", "2", "3", "4", "5", "6", "7", "8", "9"];

const VALUE_KEYS: Record<string, string> = {
  "role edge": "e", "role lane": "l", "role centre": "i",
  "pattern solid": "s", "pattern dashed": "h",
  "form kerb": "k", "form edge": "g", "form barrier": "w",
  "condition good": "o", "condition worn": "z", "condition damaged": "u", "condition missing": ";",
};
// For values that a later server offers
const SPARE = ["[", "]", "'", ",", "Shift+1", "Shift+2", "Shift+3", "Shift+4", "Shift+5", "Shift+6"];

export function valueKeys(choices: Record<string, string[]>): Map<string, string> {
  const keys = new Map<string, string>();
  const spare = [...SPARE];
  for (const [column, values] of Object.entries(choices))
    for (const value of values) {
      const key = VALUE_KEYS[`${column} ${value}`] ?? spare.shift();
      if (key !== undefined) keys.set(`${column} ${value}`, key);
    }
  return keys;
}
