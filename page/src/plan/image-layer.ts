// The image under the lines, by tiles of the server: density, height, height above the road, intensity, or none.

import TileLayer from "ol/layer/Tile";
import type Projection from "ol/proj/Projection";
import TileImage from "ol/source/TileImage";
import TileGrid from "ol/tilegrid/TileGrid";
import { tileUrl } from "../app/api";
import type { Survey } from "../app/documents";

export class ImageLayer {
  readonly layer = new TileLayer<TileImage>({ preload: 1, cacheSize: 1024 });
  private readonly sources = new Map<string, TileImage>();

  constructor(private readonly survey: Survey, private readonly projection: Projection) {}

  // Show an image by its name; "": none
  show(name: string): void {
    this.layer.setVisible(name !== "");
    if (name === "") return;
    const source = this.sources.get(name) ?? this.sourceOf(name);
    this.sources.set(name, source);
    this.layer.setSource(source);
  }

  // Tiles that were shown in part, since not all below them were made yet, are asked for again
  again(): void {
    for (const source of this.sources.values()) source.refresh();
  }

  private sourceOf(name: string): TileImage {
    const { tile_px, origin, resolutions } = this.survey.tiles;
    return new TileImage({
      projection: this.projection,
      tileGrid: new TileGrid({ origin, resolutions, tileSize: tile_px, extent: this.survey.bounds }),
      tileUrlFunction: ([z = 0, col = 0, row = 0]) => tileUrl(name, z, col, row),
      interpolate: false, // a cell is a cell: nothing is made up between two
      transition: 0,
      wrapX: false,
    });
  }
}
