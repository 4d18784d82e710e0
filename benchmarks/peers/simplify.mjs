/** meshoptimizer's simplify: corners and positions in, corners out; for each target the number of corners first. */

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const [modules, ...targets] = process.argv.slice(2);
const { MeshoptSimplifier } = await import(createRequire(`${modules}/`).resolve("meshoptimizer"));
await MeshoptSimplifier.ready;
const given = readFileSync(0);
const [corners, numbers] = [given.readUInt32LE(0), given.readUInt32LE(4)];
const bytes = given.buffer.slice(given.byteOffset + 8);
const indices = new Uint32Array(bytes, 0, corners);
const positions = new Float32Array(bytes, 4 * corners, numbers);
for (const target of targets) {
  const [kept] = MeshoptSimplifier.simplify(indices, positions, 3, Number(target), 1);
  process.stdout.write(Buffer.from(Uint32Array.of(kept.length).buffer));
  process.stdout.write(Buffer.from(kept.buffer, kept.byteOffset, kept.byteLength));
}
