// The lines in plan, as they are saved: styled by kind, bridged stretches dashed, and bands of sigma where asked for.

import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import MultiLineString from "ol/geom/MultiLineString";
import Polygon from "ol/geom/Polygon";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import type { App } from "../app/app";
import { LineStyles } from "./line-styles";
import { sigmaBand } from "./sigma-band";
import type { Line, Vertex } from "../app/documents";

export class LineLayer {
  readonly styles: LineStyles;
  readonly source = new VectorSource<Feature<LineString>>();
  readonly layer: VectorLayer<VectorSource<Feature<LineString>>>;
  readonly bands: VectorLayer<VectorSource>;
  readonly hidden = new Set<string>(); // kinds that are switched off, and "rejected"
  sigmas = 0; // half width of the bands; 0: none
  private readonly bandSource = new VectorSource();
  private selected = new Set<string>();

  constructor(private readonly app: App) {
    this.styles = new LineStyles((kind) => app.colour(kind));
    this.bands = new VectorLayer({ source: this.bandSource });
    this.layer = new VectorLayer({
      source: this.source,
      renderBuffer: 64,
      style: (feature, resolution) => {
        const line = app.lines.get(String(feature.getId()));
        if (line === undefined || !this.isShown(line)) return [];
        return this.styles.of(line, this.selected.has(line.id), resolution);
      },
    });
    app.on("lines", ({ changed, removed }) => this.renew(changed, removed));
    app.on("selection", (ids) => this.select(ids));
  }

  isShown(line: Line): boolean {
    if (line.review === "rejected" && this.hidden.has("rejected")) return false;
    return !this.hidden.has(line.kind);
  }

  // Something changed that is not in a line: colours, what is hidden, how wide the bands are
  restyle(): void {
    this.styles.renew();
    this.layer.changed();
    this.band();
  }

  private renew(changed: Line[], removed: string[]): void {
    for (const id of removed) {
      const feature = this.source.getFeatureById(id);
      if (feature) this.source.removeFeature(feature);
    }
    const fresh: Feature<LineString>[] = [];
    for (const line of changed) {
      const known = this.source.getFeatureById(line.id) as Feature<LineString> | null;
      const feature = known ?? new Feature<LineString>();
      feature.setProperties({ ...geometriesOf(line) }, known !== null);
      feature.changed();
      if (known === null) {
        feature.setId(line.id);
        fresh.push(feature);
      }
    }
    this.source.addFeatures(fresh);
    if (this.sigmas > 0) this.band();
  }

  private select(ids: string[]): void {
    const touched = [...this.selected, ...ids];
    this.selected = new Set(ids);
    for (const id of touched) this.source.getFeatureById(id)?.changed();
  }

  private band(): void {
    this.bandSource.clear(true);
    if (this.sigmas === 0) return;
    const features: Feature[] = [];
    for (const line of this.app.lines.values()) {
      const ring = this.isShown(line) && line.review !== "rejected" ? sigmaBand(line, this.sigmas) : [];
      if (ring.length === 0) continue;
      const feature = new Feature(new Polygon([ring]));
      feature.setStyle(this.styles.band(line.kind));
      features.push(feature);
    }
    this.bandSource.addFeatures(features);
  }
}

// The whole line, and its measured and bridged stretches each by themselves
export function geometriesOf(line: Line): { geometry: LineString; measured: MultiLineString; bridged: MultiLineString } {
  const flat = (part: Vertex[]) => part.map(([east, north]) => [east, north]);
  const measured: number[][][] = [];
  const bridged: number[][][] = [];
  let at = 0;
  for (const [first, last] of line.bridged) {
    // A bridge reaches from the last measured vertex to the next one
    const [from, to] = [Math.max(first - 1, 0), Math.min(last + 1, line.xyz.length - 1)];
    if (from > at) measured.push(flat(line.xyz.slice(at, from + 1)));
    if (to > from) bridged.push(flat(line.xyz.slice(from, to + 1)));
    at = to;
  }
  if (at < line.xyz.length - 1) measured.push(flat(line.xyz.slice(at)));
  return {
    geometry: new LineString(flat(line.xyz)),
    measured: new MultiLineString(measured),
    bridged: new MultiLineString(bridged),
  };
}
