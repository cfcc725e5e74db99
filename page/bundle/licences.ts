// THIRD_PARTY_LICENSES.txt: name, version and licence of every package that a part of went into the page.

import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import type { Plugin } from "vite";

interface Package {
  name: string;
  version: string;
  license?: string;
}

function folderOf(module: string): string | null {
  const at = module.lastIndexOf("/node_modules/");
  if (at < 0) return null;
  const [first = "", second = ""] = module.slice(at + "/node_modules/".length).split("/");
  return module.slice(0, at) + "/node_modules/" + (first.startsWith("@") ? `${first}/${second}` : first);
}

function noticeOf(folder: string): string {
  const about = JSON.parse(readFileSync(join(folder, "package.json"), "utf8")) as Package;
  const files = readdirSync(folder).filter((name) => /^licen[cs]e(\.|$)/i.test(name)).sort();
  if (files.length === 0) throw new Error(`${about.name}: no licence file in its package`);
  const texts = files.map((name) => readFileSync(join(folder, name), "utf8").trim());
  return `${about.name} ${about.version} (${about.license ?? "see below"})\n\n${texts.join("\n\n")}\n`;
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
            const folder = folderOf(module);
            if (folder !== null) folders.add(folder);
          }
      // Style sheets are no modules of a chunk once they are bundled; the only one from outside is OpenLayers' own
      const notices = [...folders].sort().map(noticeOf);
      const source = `The page of the workbench holds code of these packages.\n\n${notices.join(`\n${"-".repeat(78)}\n\n`)}`;
      this.emitFile({ type: "asset", fileName: "THIRD_PARTY_LICENSES.txt", source });
    },
  };
}
