/** Small solids as OBJ, without normals. */

const CORNERS = [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => [1, 2, 4].map((bit) => (corner & bit ? 0.5 : -0.5)));
const SIDES = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"];

export const CUBE = obj("cube.obj", CORNERS, SIDES);
export const PYRAMID = obj(
  "pyramid.obj",
  [[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 2, 0]],
  ["1 2 3 4", "2 1 5", "3 2 5", "4 3 5", "1 4 5"],
);

/** The cube as a glTF: its sides are two triangles each. */
export const CUBE_OF_TRIANGLES = {
  name: "cube.gltf",
  mimeType: "model/gltf+json",
  buffer: gltf(CORNERS, SIDES.map((side) => side.split(" ").map((corner) => corner - 1))),
};

function gltf(points, quads) {
  const corners = new Uint16Array(quads.flatMap(([a, b, c, d]) => [a, b, c, a, c, d]));
  const places = new Float32Array(points.flat());
  const bytes = Buffer.concat([Buffer.from(places.buffer), Buffer.from(corners.buffer)]);
  const document = {
    asset: { version: "2.0" },
    buffers: [{ byteLength: bytes.length, uri: `data:application/octet-stream;base64,${bytes.toString("base64")}` }],
    bufferViews: [
      { buffer: 0, byteLength: places.byteLength },
      { buffer: 0, byteOffset: places.byteLength, byteLength: corners.byteLength },
    ],
    accessors: [
      { bufferView: 0, componentType: 5126, count: points.length, type: "VEC3", min: [-0.5, -0.5, -0.5], max: [0.5, 0.5, 0.5] },
      { bufferView: 1, componentType: 5123, count: corners.length, type: "SCALAR" },
    ],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }],
    nodes: [{ mesh: 0 }],
    scenes: [{ nodes: [0] }],
    scene: 0,
  };
  return Buffer.from(JSON.stringify(document));
}

function obj(name, points, faces) {
  const lines = [...points.map((point) => `v ${point.join(" ")}`), ...faces.map((face) => `f ${face}`)];
  return { name, mimeType: "", buffer: Buffer.from(lines.join("\n")) };
}
