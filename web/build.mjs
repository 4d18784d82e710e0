/**
 * Build the page: `node build.mjs [folder]`, by default ../service/web. Every file but index.html has
 * a hash of its content in its name, so it may be cached for ever; the same sources give the same bytes.
 */

import { createHash } from "node:crypto";
import { mkdir, readdir, readFile, rm, writeFile } from "node:fs/promises";
import { basename, dirname, extname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";
import { strict } from "./transcoder.mjs";

const here = dirname(fileURLToPath(import.meta.url));
const out = process.argv[2] ?? join(here, "../service/web");
const assets = join(out, "assets");
const inside = (path) => join(here, path);

await rm(assets, { recursive: true, force: true });
await mkdir(assets, { recursive: true });

const common = {
  absWorkingDir: here,
  bundle: true,
  minify: true,
  legalComments: "none",
  target: ["es2022", "chrome111", "firefox113", "safari16.4"],
  outdir: assets,
  metafile: true,
  logLevel: "warning",
};

const draco = "node_modules/three/examples/jsm/libs/draco/gltf/";
const basis = "node_modules/three/examples/jsm/libs/basis/";
const names = {
  BASIS_WRAPPER: await written(
    "basis_transcoder.js",
    strict(await readFile(inside(basis + "basis_transcoder.js"), "utf8")),
  ),
  BASIS_WASM: await copied(basis + "basis_transcoder.wasm"),
  DRACO_WRAPPER: await copied(draco + "draco_wasm_wrapper.js"),
  DRACO_WASM: await copied(draco + "draco_decoder.wasm"),
  EXAMPLE: await copied("static/example.glb"),
  VALIDATOR: await validator(),
};
const define = Object.fromEntries(
  Object.entries(names).map(([name, file]) => [name, JSON.stringify(`./${file}`)]),
);
const page = await build({
  ...common,
  entryPoints: ["src/main.ts", "src/style.css"],
  entryNames: "[name]-[hash]",
  chunkNames: "part-[hash]",
  format: "esm",
  splitting: true,
  define,
});

const html = (await readFile(inside("src/index.html"), "utf8"))
  .replaceAll("{{script}}", `assets/${entry(page, "src/main.ts")}`)
  .replaceAll("{{style}}", `assets/${entry(page, "src/style.css")}`)
  .replaceAll("{{icon}}", `assets/${await copied("static/icon.svg")}`)
  .replaceAll("{{licences}}", `assets/${await written("licences.txt", await licences())}`);
await writeFile(join(out, "index.html"), html);

/** The validator is a classic worker: dart2js looks for `self`, and must not think it is in node. */
async function validator() {
  const made = await build({
    ...common,
    entryPoints: ["src/validate/worker.ts"],
    entryNames: "validator-[hash]",
    format: "iife",
    define: { global: "self", process: "undefined" },
  });
  return entry(made, "src/validate/worker.ts");
}

function entry({ metafile }, source) {
  const [path] = Object.entries(metafile.outputs).find(([, made]) => made.entryPoint === source);
  return basename(path);
}

async function copied(path) {
  return written(basename(path), await readFile(inside(path)));
}

async function written(path, content) {
  const hash = createHash("sha256").update(content).digest("hex").slice(0, 8);
  const name = `${basename(path, extname(path))}-${hash}${extname(path)}`;
  await writeFile(join(assets, name), content);
  return name;
}

async function licences() {
  const parts = [
    ["three.js", "node_modules/three/LICENSE"],
    ["fflate, within three.js", "node_modules/fflate/LICENSE"],
    ["three-mesh-bvh", "node_modules/three-mesh-bvh/LICENSE"],
    ["meshoptimizer's decoder, within three.js", "node_modules/meshoptimizer/LICENSE.md"],
    ["Draco's decoder, within three.js", "licences/draco.txt"],
    ["Basis Universal's transcoder, within three.js", "licences/basis_universal.txt"],
    ["ktx-parse and zstddec, within three.js", "licences/ktx_parse.txt"],
    ["glTF Validator", "node_modules/gltf-validator/LICENSE"],
    ["glTF Validator, notices", "node_modules/gltf-validator/NOTICES"],
  ];
  const texts = parts.map(async ([name, path]) => {
    const text = (await readFile(inside(path), "utf8")).replaceAll("\r\n", "\n").trim();
    return `${"=".repeat(78)}\n${name}\n${"=".repeat(78)}\n\n${text}\n`;
  });
  return (await Promise.all(texts)).join("\n");
}

console.log((await readdir(assets)).sort().join("\n"));
