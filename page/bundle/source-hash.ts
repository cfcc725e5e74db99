// Writes SOURCES.sha256, the hash of the page's sources, so that tests/workbench/page/test_bundle.py can tell a stale build.

import { createHash } from "node:crypto";
import { readdirSync, readFileSync } from "node:fs";
import { join, relative, sep } from "node:path";
import type { Plugin } from "vite";

const PARTS = ["bundle", "index.html", "package-lock.json", "package.json", "src", "tsconfig.json", "vite.config.ts"];

function filesOf(root: string): string[] {
  const found: string[] = [];
  for (const part of PARTS) {
    if (/\.[a-z]+$/.test(part)) found.push(part);
    else
      for (const entry of readdirSync(join(root, part), { recursive: true, withFileTypes: true }))
        if (entry.isFile()) found.push(relative(root, join(entry.parentPath, entry.name)).split(sep).join("/"));
  }
  return found.sort((a, b) => (a < b ? -1 : 1));
}

// For every file, in order of name: name, line feed, length in bytes, line feed, content
export function hashOfSources(root: string): string {
  const sum = createHash("sha256");
  for (const file of filesOf(root)) {
    const bytes = readFileSync(join(root, file));
    sum.update(`${file}\n${bytes.length}\n`);
    sum.update(bytes);
  }
  return sum.digest("hex");
}

export function sourceHash(): Plugin {
  let root = "";
  return {
    name: "source-hash",
    apply: "build",
    configResolved(config) {
      root = config.root;
    },
    generateBundle() {
      this.emitFile({ type: "asset", fileName: "SOURCES.sha256", source: `${hashOfSources(root)}\n` });
    },
  };
}
