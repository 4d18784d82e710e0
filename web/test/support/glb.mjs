/** GLBs taken apart and put together by code of the tests' own. */

const JSON_CHUNK = 0x4e4f534a;
const BIN_CHUNK = 0x004e4942;

export function read(bytes) {
  const buffer = Buffer.from(bytes);
  const length = buffer.readUInt32LE(12);
  const json = JSON.parse(buffer.subarray(20, 20 + length).toString());
  const start = 20 + length + 8;
  return { json, bin: buffer.subarray(start, start + buffer.readUInt32LE(start - 8)) };
}

export function write({ json, bin }) {
  const text = padded(Buffer.from(JSON.stringify(json)), 0x20);
  const data = padded(bin, 0);
  const head = Buffer.alloc(12);
  head.writeUInt32LE(0x46546c67, 0);
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(12 + 8 + text.length + 8 + data.length, 8);
  return Buffer.concat([head, chunk(text, JSON_CHUNK), chunk(data, BIN_CHUNK)]);
}

export function positions(bytes) {
  const { json, bin } = read(bytes);
  return json.meshes.flatMap((mesh) =>
    mesh.primitives.map(({ attributes }) => {
      const accessor = json.accessors[attributes.POSITION];
      const view = json.bufferViews[accessor.bufferView];
      const at = bin.byteOffset + (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
      return new Float32Array(bin.buffer.slice(at, at + 12 * accessor.count));
    }),
  );
}

/** The largest angle, in degrees, between two triangles that share an edge, whose ends are told by their places. */
export function largestTurn(bytes) {
  const { json, bin } = read(bytes);
  const places = positions(bytes);
  const beside = new Map();
  let largest = 0;
  json.meshes.flatMap((mesh) => mesh.primitives).forEach(({ indices }, primitive) => {
    const { bufferView, byteOffset = 0, componentType, count } = json.accessors[indices];
    const at = bin.byteOffset + (json.bufferViews[bufferView].byteOffset ?? 0) + byteOffset;
    const Kind = { 5121: Uint8Array, 5123: Uint16Array, 5125: Uint32Array }[componentType];
    const corners = new Kind(bin.buffer.slice(at, at + count * Kind.BYTES_PER_ELEMENT));
    for (let first = 0; first < count; first += 3) {
      const points = [0, 1, 2].map((k) => [...places[primitive].slice(3 * corners[first + k], 3 * corners[first + k] + 3)]);
      const normal = unitNormal(points);
      for (const [start, end] of [[0, 1], [1, 2], [2, 0]]) {
        const key = [points[start], points[end]].map(String).sort().join(" ");
        const other = beside.get(key);
        if (other) largest = Math.max(largest, angle(normal, other));
        beside.set(key, normal);
      }
    }
  });
  return largest;
}

function unitNormal([a, b, c]) {
  const [u, v] = [b, c].map((point) => point.map((value, axis) => value - a[axis]));
  const normal = [0, 1, 2].map((i) => u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]);
  return normal.map((value) => value / Math.hypot(...normal));
}

function angle(one, other) {
  const cosine = one.reduce((sum, value, axis) => sum + value * other[axis], 0);
  return (Math.acos(Math.max(-1, Math.min(1, cosine))) * 180) / Math.PI;
}

export function report(bytes) {
  return read(bytes).json.asset.extras.pns;
}

/** The same file, whose first node moves by `way` along x within a second. */
export function moving(bytes, way) {
  const { json, bin } = read(bytes);
  const start = padded(bin, 0).length;
  const track = Buffer.alloc(4 * (2 + 6));
  [0, 1, 0, 0, 0, way, 0, 0].forEach((value, i) => track.writeFloatLE(value, 4 * i));
  const view = json.bufferViews.length;
  json.bufferViews.push(
    { buffer: 0, byteOffset: start, byteLength: 8 },
    { buffer: 0, byteOffset: start + 8, byteLength: 24 },
  );
  const accessor = json.accessors.length;
  json.accessors.push(
    { bufferView: view, componentType: 5126, count: 2, type: "SCALAR", min: [0], max: [1] },
    { bufferView: view + 1, componentType: 5126, count: 2, type: "VEC3" },
  );
  json.animations = [
    {
      name: "There",
      samplers: [{ input: accessor, output: accessor + 1 }],
      channels: [{ sampler: 0, target: { node: 0, path: "translation" } }],
    },
  ];
  const whole = Buffer.concat([padded(bin, 0), track]);
  json.buffers[0].byteLength = whole.length;
  return write({ json, bin: whole });
}

/** The same file, whose first mesh moves by one joint. */
export function rigged(bytes) {
  const { json, bin } = read(bytes);
  const { attributes } = json.meshes[0].primitives[0];
  const { count } = json.accessors[attributes.POSITION];
  const start = padded(bin, 0).length;
  const view = json.bufferViews.length;
  json.bufferViews.push({ buffer: 0, byteOffset: start, byteLength: 4 * count }, { buffer: 0, byteOffset: start + 4 * count, byteLength: 16 * count });
  attributes.JOINTS_0 = json.accessors.length;
  attributes.WEIGHTS_0 = json.accessors.length + 1;
  json.accessors.push(
    { bufferView: view, componentType: 5121, count, type: "VEC4" },
    { bufferView: view + 1, componentType: 5126, count, type: "VEC4" },
  );
  const weights = Float32Array.from({ length: 4 * count }, (_, i) => Number(i % 4 === 0));
  json.nodes.push({ name: "Joint" });
  json.scenes[0].nodes.push(json.nodes.length - 1);
  json.skins = [{ joints: [json.nodes.length - 1] }];
  json.nodes.find(({ mesh }) => mesh === 0).skin = 0;
  const whole = Buffer.concat([padded(bin, 0), Buffer.alloc(4 * count), Buffer.from(weights.buffer)]);
  json.buffers[0].byteLength = whole.length;
  return write({ json, bin: whole });
}

/** A tetrahedron with neither normals nor a material. */
export function bare() {
  const positions = Buffer.from(new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1]).buffer);
  const faces = Buffer.from(new Uint16Array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]).buffer);
  const bin = Buffer.concat([positions, faces]);
  return {
    asset: { version: "2.0" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1 }] }],
    accessors: [
      { bufferView: 0, componentType: 5126, count: 4, type: "VEC3", min: [0, 0, 0], max: [1, 1, 1] },
      { bufferView: 1, componentType: 5123, count: 12, type: "SCALAR" },
    ],
    bufferViews: [
      { buffer: 0, byteOffset: 0, byteLength: 48 },
      { buffer: 0, byteOffset: 48, byteLength: 24 },
    ],
    buffers: [{ byteLength: bin.length, uri: dataUri(bin) }],
  };
}

/** A square with a texture in KTX2 and no light, upright before the first view: a glTF beside its texture. */
export function textured(texture) {
  const pieces = [
    Buffer.from(new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]).buffer),
    Buffer.from(new Float32Array([0, 1, 1, 1, 1, 0, 0, 0]).buffer),
    Buffer.from(new Uint16Array([0, 1, 2, 0, 2, 3]).buffer),
  ];
  const bin = Buffer.concat(pieces);
  return {
    asset: { version: "2.0" },
    extensionsUsed: ["KHR_texture_basisu", "KHR_materials_unlit"],
    extensionsRequired: ["KHR_texture_basisu"],
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0, TEXCOORD_0: 1 }, indices: 2, material: 0 }] }],
    materials: [
      { pbrMetallicRoughness: { baseColorTexture: { index: 0 } }, extensions: { KHR_materials_unlit: {} } },
    ],
    textures: [{ extensions: { KHR_texture_basisu: { source: 0 } } }],
    images: [{ uri: texture, mimeType: "image/ktx2" }],
    accessors: [
      { bufferView: 0, componentType: 5126, count: 4, type: "VEC3", min: [-1, -1, 0], max: [1, 1, 0] },
      { bufferView: 1, componentType: 5126, count: 4, type: "VEC2" },
      { bufferView: 2, componentType: 5123, count: 6, type: "SCALAR" },
    ],
    bufferViews: [
      { buffer: 0, byteOffset: 0, byteLength: 48 },
      { buffer: 0, byteOffset: 48, byteLength: 32 },
      { buffer: 0, byteOffset: 80, byteLength: 12 },
    ],
    buffers: [{ byteLength: bin.length, uri: dataUri(bin) }],
  };
}

/** The same file with a position that is no number. */
export function broken(bytes) {
  const { json, bin } = read(bytes);
  const changed = Buffer.from(bin);
  const accessor = json.accessors[json.meshes[0].primitives[0].attributes.POSITION];
  changed.writeFloatLE(NaN, json.bufferViews[accessor.bufferView].byteOffset ?? 0);
  return write({ json, bin: changed });
}

function dataUri(bytes) {
  return `data:application/octet-stream;base64,${bytes.toString("base64")}`;
}

function chunk(data, kind) {
  const head = Buffer.alloc(8);
  head.writeUInt32LE(data.length, 0);
  head.writeUInt32LE(kind, 4);
  return Buffer.concat([head, data]);
}

function padded(data, filler) {
  return Buffer.concat([data, Buffer.alloc((4 - (data.length % 4)) % 4, filler)]);
}
