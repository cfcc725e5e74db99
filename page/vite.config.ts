// One script, one style sheet, no hash in a name: two builds of the same sources are the same bytes.

import { defineConfig } from "vite";
import { licences } from "./bundle/licences.ts";
import { sourceHash } from "./bundle/source-hash.ts";

export default defineConfig({
  base: "./",
  build: {
    outDir: "../src/linework/workbench/page",
    emptyOutDir: true,
    assetsInlineLimit: 0, // the page's security policy has no data: addresses
    modulePreload: false,
    target: "es2022",
    reportCompressedSize: false,
    chunkSizeWarningLimit: 2000,
    rolldownOptions: {
      output: {
        entryFileNames: "[name].js",
        chunkFileNames: "[name].js",
        assetFileNames: "[name][extname]",
      },
    },
  },
  plugins: [licences(), sourceHash()],
});
