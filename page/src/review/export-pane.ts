// Export: the lines as they are saved now, in the format that other programs want, with a choice of kinds and, for CAD,
// the survey's table of feature codes.

import "./export-pane.css";
import * as api from "../app/api";
import type { App } from "../app/app";
import type { Line } from "../app/documents";
import { fill } from "../controls/bar";
import { button, element } from "../controls/element";
import type { Pane } from "../controls/tabs";

const FORMATS = [
  ["gpkg", "GeoPackage (.gpkg)"], ["dxf", "CAD drawing (.dxf)"], ["geojson", "GeoJSON (.geojson)"], ["landxml", "LandXML (.landxml)"],
  ["parquet", "GeoParquet (.parquet)"], ["fgb", "FlatGeobuf (.fgb)"], ["kml", "Google Earth (.kml)"],
  ["osm", "Lanelet2 (.osm)"], ["xodr", "OpenDRIVE (.xodr)"],
] as const;
const WITH_LANES = new Set(["gpkg", "geojson", "osm", "xodr"]);
const EXAMPLE = "kind,pattern,role,form,layer,code,color,linetype\nlane_marking,dashed,,,ROAD-MARK-DASHED,210,#ffffff,dashed\n";

export class ExportPane implements Pane {
  readonly element: HTMLElement;
  private readonly format = element("select", { "aria-label": "Format", name: "format" });
  private readonly which = element("select", { "aria-label": "Lines to export", name: "which" });
  private readonly kinds = element("fieldset", { class: "kinds" });
  private readonly lanes = element("input", { type: "checkbox", name: "lanes" });
  private readonly location = element("select", { "aria-label": "Location of the lanelets", name: "location" });
  private readonly codes = element("textarea", {
    name: "codes", rows: 6, spellcheck: "false", "aria-label": "Feature codes, CSV", placeholder: EXAMPLE,
  });
  private readonly coded = element("input", { type: "checkbox", name: "coded" });
  private readonly start = button("Export the lines to a file", "Export", () => void this.export(), { class: "start" });
  private readonly words = element("ul", { class: "words", role: "status" });
  private readonly laneRow = element("div", { class: "lanes" });
  private readonly codeRow = element("fieldset", { class: "codes" });
  private saved = ""; // the table as the server has it

  // `listed`: the lines that the table lists
  constructor(private readonly app: App, private readonly listed: () => Line[]) {
    fill(this.format, FORMATS);
    fill(this.which, [["all", "all lines"], ["listed", "lines shown by the filter"], ["selected", "selected lines"]]);
    fill(this.location, [["urban", "urban"], ["nonurban", "outside towns"], ["private", "private"]]);
    this.laneRow.append(element("label", {}, this.lanes, "Lanes between the lines"), this.location);
    this.codeRow.append(
      element("legend", {}, "Feature codes"),
      element("label", {}, this.coded, "Layers and codes of this table"),
      this.codes,
      button("Save the table beside the lines", "Save table", () => void this.saveCodes(), { class: "save" }),
    );
    this.element = element("div", { class: "export-pane" },
      element("label", {}, "Format", this.format), element("label", {}, "Lines", this.which), this.kinds,
      this.laneRow, this.codeRow,
      element("p", { class: "quiet" }, "Rejected lines are left out."), this.start, this.words,
    );
    for (const one of [this.format, this.lanes]) one.addEventListener("change", () => this.show());
    app.on("lines", () => this.showKinds());
    this.showKinds();
    this.show();
    void this.load();
  }

  private show(): void {
    const format = this.format.value;
    this.laneRow.hidden = !WITH_LANES.has(format);
    this.location.hidden = format !== "osm" || !this.lanes.checked;
    this.codeRow.hidden = format !== "dxf";
  }

  // A box per kind that there is; one that was switched off stays so
  private showKinds(): void {
    const off = new Set([...this.kinds.querySelectorAll<HTMLInputElement>("input:not(:checked)")].map(({ value }) => value));
    const found = [...new Set([...this.app.lines.values()].map(({ kind }) => kind))].sort();
    this.kinds.replaceChildren(element("legend", {}, "Layers"), ...found.map((kind) =>
      element("label", {}, element("input", { type: "checkbox", name: "layer", value: kind, checked: !off.has(kind) }), this.app.title(kind))));
  }

  private async load(): Promise<void> {
    try {
      const { text } = await api.codes();
      this.saved = this.codes.value = text;
      this.coded.checked = text !== "";
    } catch (error) {
      this.app.reportProblem(error);
    }
  }

  private async saveCodes(): Promise<boolean> {
    try {
      this.saved = (await api.saveCodes(this.codes.value)).text;
      this.app.emit("message", { text: "The table of feature codes is saved beside the lines.", kind: "info" });
      return true;
    } catch (error) {
      this.app.reportProblem(error);
      return false;
    }
  }

  private async export(): Promise<void> {
    const kinds = [...this.kinds.querySelectorAll<HTMLInputElement>("input:checked")].map(({ value }) => value);
    if (kinds.length === 0) return this.app.reportProblem(new Error("Select at least one layer to export."));
    const ids = { all: null, listed: this.listed().map(({ id }) => id), selected: this.app.selection }[this.which.value] ?? null;
    const format = this.format.value;
    const coded = format === "dxf" && this.coded.checked;
    const lanes = WITH_LANES.has(format) && this.lanes.checked;
    this.start.disabled = true;
    this.words.replaceChildren();
    try {
      if (coded && this.codes.value !== this.saved && !(await this.saveCodes())) return;
      const { name, blob, warnings } = await api.exportLines({
        format, kinds, ids, coded, lanes, location: lanes && format === "osm" ? this.location.value : "",
      });
      download(name, blob);
      // In a low window the list is below the fold
      this.app.emit("message", { text: `Exported: ${name}${warnings.length ? `; ${warnings.length} to read below the button` : ""}`, kind: "info" });
      this.words.append(...[`Exported: ${name}`, ...warnings].map((text) => element("li", {}, text)));
    } catch (error) {
      this.app.reportProblem(error);
    } finally {
      this.start.disabled = false;
    }
  }
}

function download(name: string, blob: Blob): void {
  const url = URL.createObjectURL(blob);
  element("a", { href: url, download: name }).click();
  window.setTimeout(() => URL.revokeObjectURL(url), 60_000); // the browser may still be reading it
}
