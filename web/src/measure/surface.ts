/** What the surface of a file is before refinement, counted as the service's report counts it after. */

import type { BufferGeometry, Mesh } from "three";
import { corners, surfaces, weld } from "./weld";

export interface Surface {
  vertices: number;
  /** Edges with one face. */
  boundary: number;
  /** Edges with three faces and more. */
  irregular: number;
}

/** The meshes of a file, each counted once however many nodes show it. */
export function surfaceOf(meshes: Mesh[]): Surface {
  const sum = { vertices: 0, boundary: 0, irregular: 0 };
  for (const geometries of surfaces(meshes)) count(geometries, sum);
  return sum;
}

/** Add the counts of one mesh, whose primitives are welded to each other. */
function count(geometries: BufferGeometry[], sum: Surface): void {
  const joined = weld(geometries);
  const used = new Set<number>();
  const facesAt = new Map<number, number>();
  let first = 0;
  for (const geometry of geometries) {
    const at = corners(geometry);
    for (let corner = 0; corner + 2 < at.length; corner += 3) {
      const face = [0, 1, 2].map((next) => joined[first + at[corner + next]!]!);
      // A face that names a vertex twice is none.
      if (new Set(face).size < 3) continue;
      face.forEach((p, side) => {
        const q = face[(side + 1) % 3]!;
        const edge = Math.min(p, q) * joined.length + Math.max(p, q);
        used.add(p);
        facesAt.set(edge, (facesAt.get(edge) ?? 0) + 1);
      });
    }
    first += geometry.getAttribute("position").count;
  }
  sum.vertices += used.size;
  for (const faces of facesAt.values()) {
    if (faces === 1) sum.boundary++;
    if (faces > 2) sum.irregular++;
  }
}
