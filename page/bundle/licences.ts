// Writes THIRD_PARTY_LICENSES.txt: name, version and licence text of every package bundled into the page.

import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import type { Plugin } from "vite";

interface Package {
  name: string;
  version: string;
  license?: string;
}

function packageFolder(module: string): string | null {
  const at = module.lastIndexOf("/node_modules/");
  if (at < 0) return null;
  const [first = "", second = ""] = module.slice(at + "/node_modules/".length).split("/");
  return module.slice(0, at) + "/node_modules/" + (first.startsWith("@") ? `${first}/${second}` : first);
}

function notice(folder: string): string {
  const manifest = JSON.parse(readFileSync(join(folder, "package.json"), "utf8")) as Package;
  const files = readdirSync(folder).filter((name) => /^licen[cs]e(\.|$)/i.test(name)).sort();
  if (files.length === 0) throw new Error(`${manifest.name}: no licence file in its package`);
  const texts = files.map((name) => readFileSync(join(folder, name), "utf8").trim());
  return `${manifest.name} ${manifest.version} (${manifest.license ?? "see below"})\n\n${texts.join("\n\n")}\n`;
}

export function licences(): Plugin {
  return {
    name: "licences",
    apply: "build",
    generateBundle(_, bundle) {
      const folders = new Set<string>();
      for (const part of Object.values(bundle))
        if (part.type === "chunk")
          for (const module of part.moduleIds) {
            const folder = packageFolder(module);
            if (folder !== null) folders.add(folder);
          }
      // Style sheets are not modules of a chunk; the only third-party one is that of OpenLayers, which is listed anyway
      const notices = [...folders].sort().map(notice);
      const source = `The workbench page contains code from these packages.\n\n${notices.join(`\n${"-".repeat(78)}\n\n`)}`;
      this.emitFile({ type: "asset", fileName: "THIRD_PARTY_LICENSES.txt", source });
    },
  };
}
