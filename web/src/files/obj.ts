/** OBJ: places and faces, whatever objects, groups and lines they stand among. */

import { BufferAttribute, BufferGeometry } from "three";

export function readObj(source: string): BufferGeometry {
  const points: number[] = [];
  const index: number[] = [];
  const lines = source.replace(/#.*/g, "").replace(/\\\r?\n/g, " ");
  for (const [, kind, rest] of lines.matchAll(/^[ \t]*([vf])[ \t]+(.+)$/gm)) {
    const words = rest!.trim().split(/\s+/);
    if (kind === "v") {
      points.push(Number(words[0]), Number(words[1]), Number(words[2]));
      continue;
    }
    const last = points.length / 3;
    // From 1; below 0 they count back. Texture coordinates and normals follow after a slash.
    const corners = words.map((word) => parseInt(word, 10)).map((at) => (at < 0 ? last + at : at - 1));
    for (let corner = 2; corner < corners.length; corner++) {
      index.push(corners[0]!, corners[corner - 1]!, corners[corner]!);
    }
  }
  if (!index.length) throw new Error("it has no faces");
  if (index.some((at) => !(at >= 0 && 3 * at < points.length))) {
    throw new Error("a face names a vertex that it does not have");
  }
  return new BufferGeometry()
    .setAttribute("position", new BufferAttribute(new Float32Array(points), 3))
    .setIndex(index);
}
