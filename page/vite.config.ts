// One script, one style sheet, no hashes in file names: building the same sources twice gives the same bytes.

import { defineConfig } from "vite";
import { licences } from "./bundle/licences.ts";
import { sourceHash } from "./bundle/source-hash.ts";

export default defineConfig({
  base: "./",
  build: {
    outDir: "../src/linework/workbench/page",
    emptyOutDir: true,
    assetsInlineLimit: 0, // files instead of data: URLs, which the security policy allows for images only
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
