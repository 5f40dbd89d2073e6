// Builds the bundle that the Rust crate embeds. `node build.mjs` writes it; `node build.mjs --check` compares.
//
// The first line of the bundle holds two digests: of all sources, and of what follows. A cargo test computes both again
// (crates/stonewise/tests/bundle.rs), so that no one needs node to see that bundle and sources agree.
import { build } from "esbuild";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { dirname, join, relative } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const assets = join(here, "../crates/stonewise/assets");

/** FNV-1a, 64 bits (Fowler, Noll & Vo): enough to see a change that nobody made on purpose. */
function digest(parts) {
  let hash = 0xcbf29ce484222325n;
  for (const bytes of parts) {
    for (const byte of bytes) hash = BigInt.asUintN(64, (hash ^ BigInt(byte)) * 0x100000001b3n);
  }
  return hash.toString(16).padStart(16, "0");
}

/** Every file that the bundle is made from: paths relative to `web/`, sorted. */
function sources() {
  const inside = readdirSync(join(here, "src"), { recursive: true, withFileTypes: true })
    .filter((entry) => entry.isFile())
    .map((entry) => relative(here, join(entry.parentPath, entry.name)));
  return [...inside, "build.mjs", "package-lock.json", "package.json", "tsconfig.json"].sort();
}

function sourceDigest() {
  return digest(sources().flatMap((path) => [Buffer.from(path), readFileSync(join(here, path))]));
}

const licence = readFileSync(join(here, "node_modules/three/LICENSE"), "utf8").trim();
const result = await build({
  entryPoints: [join(here, "src/main.ts")],
  bundle: true,
  minify: true,
  format: "iife",
  target: ["es2022"],
  charset: "utf8",
  legalComments: "none",
  outdir: assets,
  entryNames: "report",
  write: false,
  logLevel: "warning",
});

const files = new Map(result.outputFiles.map((file) => [file.path.endsWith(".css") ? "report.css" : "report.js", file.text]));
const script = `/* This bundle contains three.js.\n${licence}\n*/\n${files.get("report.js")}`;
const head = `/* stonewise report; sources ${sourceDigest()}, bundle ${digest([Buffer.from(script), Buffer.from(files.get("report.css"))])} */\n`;
files.set("report.js", head + script);

const check = process.argv.includes("--check");
for (const [name, text] of files) {
  const path = join(assets, name);
  if (!check) writeFileSync(path, text);
  else if (readFileSync(path, "utf8") !== text) {
    console.error(`${relative(process.cwd(), path)} is not what the sources make: run \`npm run build\` and commit it`);
    process.exitCode = 1;
  }
}
console.log(`${check ? "checked" : "wrote"} report.js, ${Math.round(files.get("report.js").length / 1024)} KiB`);
