import { gzipSync } from "node:zlib";
import { defineConfig } from "vite";

// WebAssembly of onnxruntime-web, for pages without a server: packed, as few hosts would do that.
const runtime = {
  name: "runtime",
  enforce: "post",
  generateBundle(_, bundle) {
    for (const [fileName, { source }] of Object.entries(bundle)) {
      if (!fileName.endsWith(".wasm")) continue;
      delete bundle[fileName];
      const packed = gzipSync(source, { level: 9 });
      this.emitFile({ type: "asset", fileName: "onnxruntime.bin", source: packed });
    }
  },
};

// Into the Python package, from where the service answers: the page, and the API's description.
// Paths are relative, so that it may stand behind any prefix.
export default defineConfig({
  base: "./",
  plugins: [runtime],
  build: {
    outDir: "../service/page",
    emptyOutDir: true,
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 2000,
    rolldownOptions: { input: ["index.html", "docs.html"] },
  },
  worker: { format: "es" },
});
