/** OBJ, PLY, STL and OFF as geometry: positions, an OBJ's materials, and the colours of a PLY's vertices. */

import { BufferAttribute, BufferGeometry } from "three";
import { STLLoader } from "three/addons/loaders/STLLoader.js";
import { readObj } from "./obj";
import { readPly } from "./ply";
import { addFan } from "./polygons";

export function readMesh(bytes: ArrayBuffer, kind: string): BufferGeometry {
  const geometry = READERS[kind]?.(bytes);
  if (!geometry?.getAttribute("position")?.count) throw new Error("it has no faces");
  return geometry;
}

const READERS: Record<string, (bytes: ArrayBuffer) => BufferGeometry> = {
  obj: (bytes) => readObj(text(bytes)),
  ply: readPly,
  stl: (bytes) => new BufferGeometry().setAttribute("position", new STLLoader().parse(bytes).getAttribute("position")),
  off: (bytes) => readOff(text(bytes)),
};

/** OFF: counts, a vertex a line, a polygon a line; what follows a polygon's corners is its colour. */
function readOff(source: string): BufferGeometry {
  const lines = source
    .replace(/#.*/g, "")
    .replace(/^\s*[A-Z0-9]*OFF\b/, "\n")
    .split("\n")
    .map((line) => line.trim().split(/\s+/).map(Number))
    .filter((numbers) => numbers.length > 1 || numbers[0]);
  const [vertices = 0, faces = 0] = lines[0] ?? [];
  const points = lines.slice(1, 1 + vertices).flatMap((line) => line.slice(0, 3));
  const index: number[] = [];
  for (const [corners = 0, ...polygon] of lines.slice(1 + vertices, 1 + vertices + faces)) {
    addFan(index, polygon.slice(0, corners));
  }
  if (points.length < 3 * vertices || !index.length || index.some((at) => !(at < vertices))) {
    throw new Error("its counts and its lines disagree");
  }
  return new BufferGeometry()
    .setAttribute("position", new BufferAttribute(new Float32Array(points), 3))
    .setIndex(index);
}

function text(bytes: ArrayBuffer): string {
  return new TextDecoder().decode(bytes);
}
