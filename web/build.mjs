// Builds the bundles that the Rust crates embed: of the report and of the studio. `node build.mjs` writes them; `node build.mjs --check` compares.
//
// The first line of each bundle holds two digests: of all sources, and of what follows. A cargo test computes both again
// (tests/bundle.rs of their crates), so that no one needs node to see that bundle and sources agree.
import { build } from "esbuild";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { dirname, join, relative } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));

/** FNV-1a, 64 bits (Fowler, Noll & Vo): enough to see a change that nobody made on purpose. */
function digest(parts) {
  let hash = 0xcbf29ce484222325n;
  for (const bytes of parts) {
    for (const byte of bytes) hash = BigInt.asUintN(64, (hash ^ BigInt(byte)) * 0x100000001b3n);
  }
  return hash.toString(16).padStart(16, "0");
}

/** What is built: its name, the folders of its sources, the crate that embeds it, and whether three.js is in it. */
const BUNDLES = [
  { name: "report", folders: ["src"], crate: "stonewise-report", hasThree: true },
  { name: "studio", folders: ["src", "studio"], crate: "stonewise-studio", hasThree: false },
];

/** Every file that a bundle is made from: paths relative to `web/`, sorted. */
function sources(folders) {
  const inside = folders.flatMap((folder) => readdirSync(join(here, folder), { recursive: true, withFileTypes: true })
    .filter((entry) => entry.isFile())
    .map((entry) => relative(here, join(entry.parentPath, entry.name))));
  return [...inside, "build.mjs", "package-lock.json", "package.json", "tsconfig.json"].sort();
}

function sourceDigest(folders) {
  return digest(sources(folders).flatMap((path) => [Buffer.from(path), readFileSync(join(here, path))]));
}

const check = process.argv.includes("--check");
for (const { name, folders, crate, hasThree } of BUNDLES) {
  const assets = join(here, "../crates", crate, "assets");
  const result = await build({
    entryPoints: [join(here, folders.at(-1), "main.ts")],
    bundle: true,
    minify: true,
    format: "iife",
    target: ["es2022"],
    charset: "utf8",
    legalComments: "none",
    outdir: assets,
    entryNames: name,
    write: false,
    logLevel: "warning",
  });
  const text = (extension) => result.outputFiles.find((file) => file.path.endsWith(extension)).text;
  const licence = hasThree ? `/* This bundle contains three.js.\n${readFileSync(join(here, "node_modules/three/LICENSE"), "utf8").trim()}\n*/\n` : "";
  const script = licence + text(".js"), style = text(".css");
  const head = `/* stonewise ${name}; sources ${sourceDigest(folders)}, bundle ${digest([Buffer.from(script), Buffer.from(style)])} */\n`;
  for (const [file, content] of [[`${name}.js`, head + script], [`${name}.css`, style]]) {
    const path = join(assets, file);
    if (!check) writeFileSync(path, content);
    else if (readFileSync(path, "utf8") !== content) {
      console.error(`${relative(process.cwd(), path)} is not what the sources make: run \`npm run build\` and commit it`);
      process.exitCode = 1;
    }
  }
  console.log(`${check ? "checked" : "wrote"} ${name}.js, ${Math.round(script.length / 1024)} KiB`);
}
