// gltf_answers.mjs FILE SECONDS: how often a second a GLB is read by gltf-transform, refined once by
// three-subdivide's Loop, and written. `make bench` installs both in build/bench/node.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const require = createRequire(new URL("../../build/bench/node/package.json", import.meta.url));

const { WebIO, Accessor } = require("@gltf-transform/core");
const { BufferGeometry, BufferAttribute } = require("three");
const { LoopSubdivision } = require("three-subdivide");

const [path, seconds] = process.argv.slice(2);
const data = new Uint8Array(readFileSync(path));
const io = new WebIO();
const options = { split: false, uvSmooth: false, preserveEdges: false, flatOnly: false, maxTriangles: Infinity };

async function answer() {
  const document = await io.readBinary(data);
  const buffer = document.getRoot().listBuffers()[0];
  for (const mesh of document.getRoot().listMeshes()) {
    for (const primitive of mesh.listPrimitives()) {
      const geometry = new BufferGeometry();
      const positions = primitive.getAttribute("POSITION").getArray();
      geometry.setAttribute("position", new BufferAttribute(Float32Array.from(positions), 3));
      geometry.setIndex(new BufferAttribute(Uint32Array.from(primitive.getIndices().getArray()), 1));
      const refined = LoopSubdivision.modify(geometry, 1, options);
      const made = document.createAccessor().setType(Accessor.Type.VEC3).setBuffer(buffer);
      made.setArray(refined.attributes.position.array);
      primitive.setAttribute("POSITION", made).setIndices(null);
    }
  }
  return io.writeBinary(document);
}

await answer();
const start = performance.now();
let count = 0;
while (performance.now() - start < 1000 * seconds) {
  await answer();
  count += 1;
}
console.log((1000 * count) / (performance.now() - start));
