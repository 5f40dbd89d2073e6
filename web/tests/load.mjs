// TypeScript modules for tests that need no browser: bundled in memory, imported from there.
import { build } from "esbuild";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

/** What the lines of a TypeScript module export; paths are relative to `web/`. */
export async function load(lines) {
  const result = await build({
    stdin: { contents: lines, resolveDir: join(dirname(fileURLToPath(import.meta.url)), ".."), loader: "ts" },
    bundle: true,
    format: "esm",
    write: false,
    loader: { ".css": "empty" },
  });
  return import(`data:text/javascript;base64,${Buffer.from(result.outputFiles[0].text).toString("base64")}`);
}
