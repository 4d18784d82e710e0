/** OBJ: places, texture coordinates and faces by material, whatever objects, groups and lines they stand among. */

import { BufferAttribute, BufferGeometry } from "three";
import { addFan } from "./polygons";

/** The materials that faces name, in the order of the geometry's groups, and the files that define them. */
export interface ObjMaterials {
  names: string[];
  libraries: string[];
}

/** Read a file. `userData` of the geometry has its ObjMaterials. */
export function readObj(source: string): BufferGeometry {
  const points: number[] = [];
  const places: number[] = [];
  const libraries: string[] = [];
  // For each material, pairs of a vertex and its texture coordinates; −1 where a corner has none.
  const corners = new Map<string, [number, number][]>();
  let material = "";
  // A # may be part of a name.
  const lines = source.replace(/(^|[ \t])#.*/gm, "").replace(/\\[ \t]*\n/g, " ");
  for (const [, kind, rest] of lines.matchAll(/^[ \t]*(v|vt|fo?|usemtl|mtllib)[ \t]+(.+)$/gm)) {
    const words = rest!.trim().split(/\s+/);
    if (kind === "v") points.push(Number(words[0]), Number(words[1]), Number(words[2]));
    else if (kind === "vt") places.push(Number(words[0]), Number(words[1] ?? 0));
    else if (kind === "usemtl") material = rest!.trim();
    else if (kind === "mtllib") libraries.push(rest!.trim());
    else {
      const polygon = words.map((word): [number, number] => {
        const [vertex, place] = word.split("/");
        return [numbered(vertex, points.length / 3), numbered(place, places.length / 2)];
      });
      const triangles = corners.get(material) ?? [];
      corners.set(material, triangles);
      addFan(triangles, polygon, ([vertex]) => vertex);
    }
  }
  const all = [...corners.values()].flat();
  if (!all.length) throw new Error("it has no faces");
  if (all.some(([vertex]) => !(vertex >= 0 && 3 * vertex < points.length))) {
    throw new Error("a face names a vertex that it does not have");
  }
  const isMapped = all.some(([, place]) => place >= 0 && 2 * place < places.length);
  const geometry = isMapped ? mapped(points, places, all) : plain(points, all);
  let first = 0;
  for (const [number, triangles] of [...corners.values()].entries()) {
    geometry.addGroup(first, triangles.length, number);
    first += triangles.length;
  }
  geometry.userData = { names: [...corners.keys()], libraries } satisfies ObjMaterials;
  return geometry;
}

/** Count from 0: an OBJ counts from 1, and back from its last where a number is negative. */
function numbered(word: string | undefined, count: number): number {
  const number = parseInt(word ?? "", 10);
  if (Number.isNaN(number)) return -1;
  return number < 0 ? count + number : number - 1;
}

function plain(points: number[], corners: [number, number][]): BufferGeometry {
  return new BufferGeometry()
    .setAttribute("position", new BufferAttribute(new Float32Array(points), 3))
    .setIndex(corners.map(([vertex]) => vertex));
}

/** Make a vertex of each pair of a place in space and one in the texture. */
function mapped(points: number[], places: number[], corners: [number, number][]): BufferGeometry {
  const made = new Map<string, number>();
  const [position, uv]: [number[], number[]] = [[], []];
  const index = corners.map(([vertex, place]) => {
    const key = `${vertex}/${place}`;
    const known = made.get(key) ?? made.size;
    if (known === made.size) {
      made.set(key, known);
      position.push(...points.slice(3 * vertex, 3 * vertex + 3));
      // Corners without any take no others' away.
      uv.push(places[2 * place] ?? 0, places[2 * place + 1] ?? 0);
    }
    return known;
  });
  return new BufferGeometry()
    .setAttribute("position", new BufferAttribute(new Float32Array(position), 3))
    .setAttribute("uv", new BufferAttribute(new Float32Array(uv), 2))
    .setIndex(index);
}
