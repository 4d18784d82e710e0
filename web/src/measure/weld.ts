/** Vertices at the same place as one: the seams of a file are no edges of its surface. */

import type { BufferGeometry, Mesh } from "three";

/** The meshes of a file, once however many nodes show them, each as the geometries of its primitives. */
export function surfaces(meshes: Mesh[]): BufferGeometry[][] {
  const parts = new Map<unknown, Set<BufferGeometry>>();
  for (const { geometry, userData } of meshes) {
    const part = (userData.pnsMesh as number | undefined) ?? geometry;
    parts.set(part, (parts.get(part) ?? new Set()).add(geometry));
  }
  return [...parts.values()].map((geometries) => [...geometries]);
}

/** For each vertex of some geometries, one after another, the first one in its place. */
export function weld(geometries: BufferGeometry[]): Uint32Array {
  const first = new Map<string, number>();
  const positions = geometries.map((geometry) => geometry.getAttribute("position"));
  const joined = new Uint32Array(positions.reduce((sum, { count }) => sum + count, 0));
  let at = 0;
  for (const position of positions) {
    for (let vertex = 0; vertex < position.count; vertex++, at++) {
      // Zero has two signs and one place.
      const key = `${position.getX(vertex) + 0},${position.getY(vertex) + 0},${position.getZ(vertex) + 0}`;
      const earlier = first.get(key);
      if (earlier === undefined) first.set(key, at);
      joined[at] = earlier ?? at;
    }
  }
  return joined;
}

/** The vertex at each corner, three to a face. */
export function corners(geometry: BufferGeometry): ArrayLike<number> {
  const { count } = geometry.index ?? geometry.getAttribute("position");
  return geometry.index?.array ?? Uint32Array.from({ length: count }, (_, corner) => corner);
}
