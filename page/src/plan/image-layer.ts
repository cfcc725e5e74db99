// The image under the lines, in tiles from the server - intensity, height, height above the road, density, class or
// none - and the buttons that select it.

import TileLayer from "ol/layer/Tile";
import type Projection from "ol/proj/Projection";
import TileImage from "ol/source/TileImage";
import TileGrid from "ol/tilegrid/TileGrid";
import { tileUrl } from "../app/api";
import type { Survey } from "../app/documents";
import { element } from "../controls/element";

export class ImageLayer {
  private version = 0;
  readonly layer = new TileLayer<TileImage>({ preload: 1, cacheSize: 1024 });
  private readonly sources = new Map<string, TileImage>();

  constructor(private readonly survey: Survey, private readonly projection: Projection) {}

  // Show an image by name; "": none
  show(name: string): void {
    this.layer.setVisible(name !== "");
    if (name === "") return;
    const source = this.sources.get(name) ?? this.sourceOf(name);
    this.sources.set(name, source);
    this.layer.setSource(source);
  }

  // Classes of points depend on the lines
  linesChanged(): void {
    this.version += 1;
    for (const { name, classes } of this.survey.images) if (classes.length) this.sources.get(name)?.refresh();
  }

  // Fetch the tiles again once all are rendered: some were shown while incomplete
  reload(): void {
    this.version += 1;
    for (const source of this.sources.values()) source.refresh();
  }

  private sourceOf(name: string): TileImage {
    const { tile_px, origin, resolutions } = this.survey.tiles;
    return new TileImage({
      projection: this.projection,
      tileGrid: new TileGrid({ origin, resolutions, tileSize: tile_px, extent: this.survey.bounds }),
      tileUrlFunction: ([z = 0, col = 0, row = 0]) => tileUrl(name, z, col, row, this.version),
      interpolate: false, // show cells as they are
      transition: 0,
      wrapX: false,
    });
  }
}

export function imageSwitch(survey: Survey, show: (name: string) => void): HTMLElement {
  const row = element("div", { class: "image-switch", role: "group", "aria-label": "Background image" });
  const classes = element("div", { class: "image-classes", hidden: true });
  const select = (name: string) => {
    show(name);
    const shown = survey.images.find((image) => image.name === name)?.classes ?? [];
    classes.replaceChildren(...shown.map(({ title, colour }) => {
      const swatch = element("span", { class: "swatch" });
      swatch.style.backgroundColor = colour;
      return element("span", {}, swatch, title);
    }));
    classes.hidden = shown.length === 0;
    for (const each of row.querySelectorAll("button")) each.setAttribute("aria-pressed", String(each.dataset.image === name));
  };
  const imageButton = (name: string, title: string, unit: string) => element(
    "button", { type: "button", "data-image": name, title: unit ? `${title} [${unit}]` : title, click: () => select(name) }, title,
  );
  row.append(...survey.images.map(({ name, title, unit }) => imageButton(name, title, unit)), imageButton("", "No image", ""));
  select(survey.images[0]?.name ?? "");
  return element("div", { class: "image-choice" }, row, classes);
}
