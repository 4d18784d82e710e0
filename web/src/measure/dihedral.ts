/** The sharpest turn of the surface at each vertex. */

import { Vector3, type BufferGeometry } from "three";
import { FLAT } from "../report/format";
import type { Model } from "../view/model";
import type { Field } from "./distance";
import { corners, weld } from "./weld";

/** The largest angle, in degrees, between two faces that share an edge at the vertex; 0 where they lie flat. */
export function dihedrals(model: Model): Field {
  const values = model.meshes.map((mesh) => ofGeometry(mesh.geometry));
  // Not Math.max(...): hundreds of thousands of arguments are too many.
  return { values, max: values.flatMap((v) => v.reduce((a, b) => Math.max(a, b), 0)).reduce(
    (a, b) => Math.max(a, b), 0) };
}

function ofGeometry(geometry: BufferGeometry): Float32Array {
  const position = geometry.getAttribute("position");
  const at = corners(geometry);
  const welded = weld([geometry]);
  const normals = new Float32Array(at.length);
  const [a, b, c, ab, ac] = Array.from({ length: 5 }, () => new Vector3()) as [
    Vector3, Vector3, Vector3, Vector3, Vector3,
  ];
  // The face on one side of each edge, until the other side comes.
  const waiting = new Map<number, number>();
  const sharpest = new Float32Array(position.count);
  for (let face = 0; face + 2 < at.length; face += 3) {
    a.fromBufferAttribute(position, at[face]!);
    b.fromBufferAttribute(position, at[face + 1]!);
    c.fromBufferAttribute(position, at[face + 2]!);
    ab.subVectors(b, a).cross(ac.subVectors(c, a)).normalize().toArray(normals, face);
    if (ab.lengthSq() === 0) continue;
    for (let corner = 0; corner < 3; corner++) {
      const [p, q] = [welded[at[face + corner]!]!, welded[at[face + ((corner + 1) % 3)]!]!];
      const edge = Math.min(p, q) * position.count + Math.max(p, q);
      const other = waiting.get(edge);
      if (other === undefined) {
        waiting.set(edge, face);
        continue;
      }
      ac.fromArray(normals, other);
      const angle = (2 * Math.asin(Math.min(ab.distanceTo(ac) / 2, 1)) * 180) / Math.PI;
      if (angle < FLAT) continue;
      sharpest[p] = Math.max(sharpest[p]!, angle);
      sharpest[q] = Math.max(sharpest[q]!, angle);
    }
  }
  return sharpest.map((_, vertex) => sharpest[welded[vertex]!]!);
}
