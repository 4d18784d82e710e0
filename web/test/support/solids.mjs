/** Small solids as OBJ, without normals. */

const CORNERS = [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => [1, 2, 4].map((bit) => (corner & bit ? 0.5 : -0.5)));
const SIDES = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"];

export const CUBE = obj("cube.obj", CORNERS, SIDES);
/** A cube whose side at +Z is five times as small as the one at −Z. */
export const BLUNT = obj(
  "blunt.obj",
  CORNERS.map(([x, y, z]) => (z > 0 ? [x / 5, y / 5, z] : [x, y, z])),
  SIDES,
);
export const PYRAMID = obj(
  "pyramid.obj",
  [[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 2, 0]],
  ["1 2 3 4", "2 1 5", "3 2 5", "4 3 5", "1 4 5"],
);

function obj(name, points, faces) {
  const lines = [...points.map((point) => `v ${point.join(" ")}`), ...faces.map((face) => `f ${face}`)];
  return { name, mimeType: "", buffer: Buffer.from(lines.join("\n")) };
}
