/** The sharpest turn of the surface at each vertex. */

import { Vector3, type BufferGeometry } from "three";
import { FLAT } from "../report/format";
import type { Model } from "../view/model";
import type { Field } from "./distance";
import { corners, surfaces, weld } from "./weld";

/** The largest angle, in degrees, between two faces that share an edge at the vertex; 0 where they lie flat. */
export function dihedrals({ meshes }: Model): Field {
  const ofGeometry = new Map<BufferGeometry, Float32Array>();
  for (const geometries of surfaces(meshes)) {
    sharpest(geometries).forEach((values, number) => ofGeometry.set(geometries[number]!, values));
  }
  const values = meshes.map(({ geometry }) => ofGeometry.get(geometry)!);
  // Not Math.max(...): hundreds of thousands of arguments are too many.
  return { values, max: values.flatMap((v) => v.reduce((a, b) => Math.max(a, b), 0)).reduce(
    (a, b) => Math.max(a, b), 0) };
}

/** Of a surface that may be of several materials, the angles at each geometry's vertices. */
function sharpest(geometries: BufferGeometry[]): Float32Array[] {
  const joined = weld(geometries);
  const angles = new Float32Array(joined.length);
  const normals = new Float32Array(geometries.reduce((sum, geometry) => sum + corners(geometry).length, 0));
  const [a, b, c, ab, ac] = Array.from({ length: 5 }, () => new Vector3()) as [
    Vector3, Vector3, Vector3, Vector3, Vector3,
  ];
  // The face on one side of each edge, until the other side comes.
  const waiting = new Map<number, number>();
  let [first, face] = [0, 0];
  for (const geometry of geometries) {
    const position = geometry.getAttribute("position");
    const at = corners(geometry);
    for (let begin = 0; begin + 2 < at.length; begin += 3, face += 3) {
      a.fromBufferAttribute(position, at[begin]!);
      b.fromBufferAttribute(position, at[begin + 1]!);
      c.fromBufferAttribute(position, at[begin + 2]!);
      ab.subVectors(b, a).cross(ac.subVectors(c, a)).normalize().toArray(normals, face);
      if (ab.lengthSq() === 0) continue;
      for (let corner = 0; corner < 3; corner++) {
        const p = joined[first + at[begin + corner]!]!;
        const q = joined[first + at[begin + ((corner + 1) % 3)]!]!;
        const edge = Math.min(p, q) * joined.length + Math.max(p, q);
        const other = waiting.get(edge);
        if (other === undefined) {
          waiting.set(edge, face);
          continue;
        }
        ac.fromArray(normals, other);
        const angle = (2 * Math.asin(Math.min(ab.distanceTo(ac) / 2, 1)) * 180) / Math.PI;
        if (angle < FLAT) continue;
        angles[p] = Math.max(angles[p]!, angle);
        angles[q] = Math.max(angles[q]!, angle);
      }
    }
    first += position.count;
  }
  let start = 0;
  return geometries.map((geometry) => {
    const end = start + geometry.getAttribute("position").count;
    const own = Float32Array.from(joined.subarray(start, end), (vertex) => angles[vertex]!);
    start = end;
    return own;
  });
}
