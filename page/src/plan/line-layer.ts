// The saved lines on the map: styled by kind, bridged stretches dashed, with accuracy bands where requested.

import Feature from "ol/Feature";
import LineString from "ol/geom/LineString";
import MultiLineString from "ol/geom/MultiLineString";
import Polygon from "ol/geom/Polygon";
import VectorLayer from "ol/layer/Vector";
import VectorSource from "ol/source/Vector";
import type { App } from "../app/app";
import { LineStyles } from "./line-styles";
import type { Line, Place, Vertex } from "../app/documents";
import { REJECTED } from "../app/filter";

export class LineLayer {
  readonly styles: LineStyles;
  readonly source = new VectorSource<Feature<LineString>>();
  readonly layer: VectorLayer<VectorSource<Feature<LineString>>>;
  readonly bands: VectorLayer<VectorSource>;
  sigmas = 0; // half width of the accuracy bands in standard deviations; 0: no bands
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
    app.on("lines", ({ changed, removed }) => this.updateLines(changed, removed));
    app.on("selection", (ids) => this.select(ids));
    app.on("filter", () => this.restyle());
  }

  // What is selected is shown whatever the filter: the queue may lead to it
  isShown(line: Line): boolean {
    return this.selected.has(line.id) || this.app.filter.shows(line);
  }

  // Redraw after a change of theme, of the filter or of the accuracy bands
  restyle(): void {
    this.styles.reset();
    this.layer.changed();
    this.drawBands();
  }

  private updateLines(changed: Line[], removed: string[]): void {
    for (const id of removed) {
      const feature = this.source.getFeatureById(id);
      if (feature) this.source.removeFeature(feature);
    }
    const added: Feature<LineString>[] = [];
    for (const line of changed) {
      const known = this.source.getFeatureById(line.id) as Feature<LineString> | null;
      const feature = known ?? new Feature<LineString>();
      feature.setProperties({ ...geometriesOf(line) }, known !== null);
      feature.changed();
      if (known === null) {
        feature.setId(line.id);
        added.push(feature);
      }
    }
    this.source.addFeatures(added);
    if (this.sigmas > 0) this.drawBands();
  }

  private select(ids: string[]): void {
    const affected = [...this.selected, ...ids];
    this.selected = new Set(ids);
    for (const id of affected) this.source.getFeatureById(id)?.changed();
  }

  private drawBands(): void {
    this.bandSource.clear(true);
    if (this.sigmas === 0) return;
    const features: Feature[] = [];
    for (const line of this.app.lines.values()) {
      const ring = this.isShown(line) && line.review !== REJECTED ? sigmaBand(line, this.sigmas) : [];
      if (ring.length === 0) continue;
      const feature = new Feature(new Polygon([ring]));
      feature.setStyle(this.styles.band(line.kind));
      features.push(feature);
    }
    this.bandSource.addFeatures(features);
  }
}

// The whole line, and its measured and its bridged stretches
export function geometriesOf(line: Line): { geometry: LineString; measured: MultiLineString; bridged: MultiLineString } {
  const flat = (part: Vertex[]) => part.map(([east, north]) => [east, north]);
  const measured: number[][][] = [];
  const bridged: number[][][] = [];
  let at = 0;
  for (const [first, last] of line.bridged) {
    // A bridge extends from the last measured vertex before it to the next one
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

// The outline of the band of `sigmas` standard deviations to either side of a line; empty if the line has none
function sigmaBand(line: Line, sigmas: number): Place[] {
  const left: Place[] = [];
  const right: Place[] = [];
  line.xyz.forEach(([east, north], i) => {
    const sigma_m = line.sigma_xy_m[i] ?? null;
    const [across_e, across_n] = leftOf(line, i);
    if (sigma_m === null || Number.isNaN(across_e)) return;
    left.push([east + across_e * sigma_m * sigmas, north + across_n * sigma_m * sigmas]);
    right.push([east - across_e * sigma_m * sigmas, north - across_n * sigma_m * sigmas]);
  });
  const first = left[0];
  return first === undefined || left.length < 2 ? [] : [...left, ...right.reverse(), first];
}

// Unit vector to the left of the line at a vertex
function leftOf(line: Line, i: number): Place {
  const before = line.xyz[Math.max(i - 1, 0)];
  const after = line.xyz[Math.min(i + 1, line.xyz.length - 1)];
  if (before === undefined || after === undefined) return [NaN, NaN];
  const [east, north] = [after[0] - before[0], after[1] - before[1]];
  const length = Math.hypot(east, north);
  return length > 0 ? [-north / length, east / length] : [NaN, NaN];
}
