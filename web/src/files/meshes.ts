/** OBJ, PLY, STL and OFF as geometry: positions alone, since nothing else is refined. */

import { BufferAttribute, BufferGeometry, type Mesh } from "three";
import { OBJLoader } from "three/addons/loaders/OBJLoader.js";
import { PLYLoader } from "three/addons/loaders/PLYLoader.js";
import { STLLoader } from "three/addons/loaders/STLLoader.js";
import { mergeGeometries } from "three/addons/utils/BufferGeometryUtils.js";

export function readMesh(bytes: ArrayBuffer, kind: string): BufferGeometry {
  const geometry = READERS[kind]?.(bytes);
  if (!geometry?.getAttribute("position")?.count) throw new Error("it has no faces");
  // A PLY may have doubles, which no graphics card takes.
  const { array } = geometry.getAttribute("position");
  return new BufferGeometry()
    .setAttribute("position", new BufferAttribute(Float32Array.from(array), 3))
    .setIndex(geometry.index);
}

const READERS: Record<string, (bytes: ArrayBuffer) => BufferGeometry> = {
  obj: (bytes) => {
    const parts: BufferGeometry[] = [];
    new OBJLoader().parse(facesAlone(text(bytes))).traverse((object) => {
      if ((object as Mesh).isMesh) parts.push(positions((object as Mesh).geometry));
    });
    const merged = parts.length ? mergeGeometries(parts) : null;
    if (!merged) throw new Error("it has no faces");
    return merged;
  },
  ply: (bytes) => new PLYLoader().parse(bytes),
  stl: (bytes) => new STLLoader().parse(bytes),
  off: (bytes) => readOff(text(bytes)),
};

/** The text of an OBJ without its points and lines: of an object that has some the loader drops the faces. */
function facesAlone(source: string): string {
  return source.replace(/\\\r?\n/g, " ").replace(/^[ \t]*[lp][ \t].*$/gm, "");
}

function positions(geometry: BufferGeometry): BufferGeometry {
  return new BufferGeometry().setAttribute("position", geometry.getAttribute("position"));
}

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
    for (let corner = 2; corner < corners; corner++) {
      index.push(polygon[0]!, polygon[corner - 1]!, polygon[corner]!);
    }
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
