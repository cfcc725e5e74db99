// A small chart as an SVG: axes in the units of its values, with dots and paths.

const WIDTH = 420;
const LEFT = 40;
const FOOT = 16;
const SVG = "http://www.w3.org/2000/svg";
const STEPS = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50];

type Range = readonly [number, number];

export class Chart {
  readonly element: HTMLElement;
  private readonly svg = document.createElementNS(SVG, "svg");

  constructor(title: string, private readonly height: number, private readonly xs: Range, private readonly ys: Range) {
    this.svg.setAttribute("viewBox", `0 0 ${WIDTH} ${height}`);
    this.svg.setAttribute("role", "img");
    this.svg.setAttribute("aria-label", title);
    const caption = document.createElement("figcaption");
    caption.textContent = title;
    this.element = document.createElement("figure");
    this.element.className = "chart";
    this.element.append(caption, this.svg);
    this.axes();
  }

  dots(places: readonly (readonly [number, number])[], colour: string, radius = 1): void {
    for (const place of places) {
      if (place[1] < this.ys[0] || place[1] > this.ys[1]) continue;
      const [cx, cy] = this.at(place);
      this.add("circle", { cx, cy, r: radius, fill: colour });
    }
  }

  // Places farther apart than `most` are not joined
  path(places: readonly (readonly [number, number])[], colour: string, most = Infinity): void {
    const steps = places.map((place, i) => {
      const [x, y] = this.at(place);
      const isApart = i === 0 || place[0] - places[i - 1]![0] > most;
      return `${isApart ? "M" : "L"}${x.toFixed(1)} ${y.toFixed(1)}`;
    });
    this.add("path", { d: steps.join(""), fill: "none", stroke: colour, "stroke-width": 1.8 });
  }

  cross(place: readonly [number, number], colour: string): void {
    const [x, y] = this.at(place);
    this.add("path", { d: `M${x - 7} ${y}H${x + 7}M${x} ${y - 7}V${y + 7}`, stroke: colour, "stroke-width": 2 });
  }

  vertical(x: number, colour: string): void {
    const [px] = this.at([x, 0]);
    this.add("path", { d: `M${px} 0V${this.height - FOOT}`, stroke: colour, "stroke-width": 1, "stroke-dasharray": "3 3" });
  }

  private at([x, y]: readonly [number, number]): [number, number] {
    const [width, height] = [WIDTH - LEFT - 4, this.height - FOOT - 3];
    return [
      LEFT + ((x - this.xs[0]) / (this.xs[1] - this.xs[0])) * width,
      3 + ((this.ys[1] - y) / (this.ys[1] - this.ys[0])) * height,
    ];
  }

  private axes(): void {
    this.add("rect", { x: LEFT, y: 3, width: WIDTH - LEFT - 4, height: this.height - FOOT - 3, class: "frame" });
    for (const value of ticks(this.xs, 8)) this.label(value, this.at([value, 0])[0], this.height - 4, "middle");
    for (const value of ticks(this.ys, this.height < 70 ? 2 : 4)) {
      const y = this.at([0, value])[1];
      this.add("path", { d: `M${LEFT} ${y}H${WIDTH - 4}`, class: value === 0 ? "zero" : "grid" });
      this.label(value, LEFT - 4, y + 3, "end");
    }
  }

  private label(value: number, x: number, y: number, anchor: string): void {
    const text = this.add("text", { x, y, "text-anchor": anchor });
    text.textContent = String(value);
  }

  private add(tag: string, attributes: Record<string, string | number>): SVGElement {
    const made = document.createElementNS(SVG, tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
    this.svg.append(made);
    return made;
  }
}

function ticks([low, high]: Range, most: number): number[] {
  const by = STEPS.find((step) => (high - low) / step <= most) ?? 100;
  const found: number[] = [];
  for (let i = Math.ceil(low / by); i <= high / by; i++) found.push(Number((i * by).toFixed(3)) + 0);
  return found;
}
