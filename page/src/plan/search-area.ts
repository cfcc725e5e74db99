// What the search area about a refused click shows: its points, and the histogram of their intensities with the range
// that would be paint.

import type { SearchArea } from "../app/documents";
import { element } from "../controls/element";

const BARS = 32;
const HEIGHT_PX = 36;

export function searchAreaPanel(area: SearchArea): HTMLElement {
  const text = `Search area: ${area.points} points, ${area.upright_normals} with upright normals, ${area.floor} on the floor.`;
  const panel = element("div", { class: "search-area" }, element("p", {}, text));
  if (area.intensity) panel.append(histogram(area.intensity), element("p", {}, rangeText(area.intensity.proposed)));
  return panel;
}

function rangeText(proposed: [number, number] | null): string {
  if (proposed === null) return "Intensities of one class: no paint.";
  return `Intensities from ${Math.round(proposed[0])} on may be paint.`;
}

function histogram({ edges, counts, proposed }: NonNullable<SearchArea["intensity"]>): HTMLElement {
  const each = Math.max(1, Math.round(counts.length / BARS));
  const bars: { n: number; low: number }[] = [];
  for (let i = 0; i < counts.length; i += each)
    bars.push({ n: counts.slice(i, i + each).reduce((sum, n) => sum + n, 0), low: edges[i] ?? 0 });
  const most = Math.max(1, ...bars.map(({ n }) => n));
  const row = element("div", { class: "histogram", role: "img", "aria-label": "Histogram of intensities" });
  for (const { n, low } of bars) {
    const isPaint = proposed !== null && low >= proposed[0];
    const bar = element("span", { class: isPaint ? "paint" : "", title: `${n} points from intensity ${Math.round(low)}` });
    bar.style.height = `${n === 0 ? 0 : Math.max(1, (HEIGHT_PX * n) / most)}px`;
    row.append(bar);
  }
  return row;
}
