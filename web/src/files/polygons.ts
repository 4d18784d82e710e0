/** Polygons as triangles: those of one follow each other and begin with one corner, as FB_ngon_encoding has them. */

/** Add a polygon as a fan, about a corner at another vertex than that of the fan before it. */
export function addFan<T>(triangles: T[], polygon: T[], vertexOf: (corner: T) => unknown = (corner) => corner): void {
  const before = triangles.at(-3);
  const turn = before !== undefined && vertexOf(before) === vertexOf(polygon[0]!) ? 1 : 0;
  const at = (corner: number): T => polygon[(corner + turn) % polygon.length]!;
  for (let i = 2; i < polygon.length; i++) triangles.push(at(0), at(i - 1), at(i));
}

/** Whether the triangle that begins at a corner goes on with the polygon of the one before it. */
function goesOn(corners: ArrayLike<number>, begin: number): boolean {
  return begin > 0 && corners[begin] === corners[begin - 3] && corners[begin + 1] === corners[begin - 1];
}

export function countPolygons(corners: ArrayLike<number>): number {
  let count = 0;
  for (let begin = 0; begin + 2 < corners.length; begin += 3) count += Number(!goesOn(corners, begin));
  return count;
}

/** The sides of polygons, two corners each, without the edges that cut them into triangles. */
export function outline(corners: ArrayLike<number>): Uint32Array {
  const ends = new Uint32Array(2 * corners.length);
  let count = 0;
  const add = (a: number, b: number): void => {
    ends[count++] = corners[a]!;
    ends[count++] = corners[b]!;
  };
  for (let begin = 0; begin + 2 < corners.length; begin += 3) {
    if (!goesOn(corners, begin)) add(begin, begin + 1);
    add(begin + 1, begin + 2);
    if (!goesOn(corners, begin + 3)) add(begin + 2, begin);
  }
  return ends.subarray(0, count);
}
