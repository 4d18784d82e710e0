/** OBJ, PLY, STL, OFF and 3MF as geometry: positions, an OBJ's materials, and the colours of a PLY or a 3MF. */

import { BufferGeometry } from "three";
import { STLLoader } from "three/addons/loaders/STLLoader.js";
import { readObj } from "./obj";
import { readOff } from "./off";
import { readPly } from "./ply";
import { textOf } from "./text";
import { read3mf } from "./threemf";

export function readMesh(bytes: ArrayBuffer, kind: string): BufferGeometry {
  const geometry = READERS[kind]?.(bytes);
  if (!geometry?.getAttribute("position")?.count) throw new Error("it has no faces");
  return geometry;
}

const READERS: Record<string, (bytes: ArrayBuffer) => BufferGeometry> = {
  obj: (bytes) => readObj(textOf(bytes)),
  ply: readPly,
  stl: (bytes) => new BufferGeometry().setAttribute("position", new STLLoader().parse(bytes).getAttribute("position")),
  off: readOff,
  "3mf": read3mf,
};
