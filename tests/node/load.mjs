// three.js's GLTFLoader over GLBs: prints one JSON object, path -> what it made of the file, or its error.
import { readFile } from "node:fs/promises";
import { dirname } from "node:path";
import { pathToFileURL } from "node:url";
import draco3d from "draco3dgltf";
import { AnimationMixer, Box3, BufferAttribute, BufferGeometry, Texture, Vector3 } from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { MeshoptDecoder } from "three/examples/jsm/libs/meshopt_decoder.module.js";

// What three.js expects of a browser: files beside a .gltf are fetched, with progress.
globalThis.self = globalThis;
globalThis.ProgressEvent ??= class extends Event {};
const fetchOverHttp = globalThis.fetch;
globalThis.fetch = async (request) =>
  request.url.startsWith("file:") ? new Response(await readFile(new URL(request.url))) : fetchOverHttp(request);

// Clips that are played, of files that have many.
const POSES = 3;

// three's DRACOLoader needs a browser's workers; this does its part with the same decoder.
class DracoLoader {
  async preload() {
    this.module ??= await draco3d.createDecoderModule({});
    return this;
  }

  async decodeDracoFile(buffer, callback, ids, types, colorSpace, onError) {
    try {
      await this.preload();
      callback(this.decode(buffer, ids, types));
    } catch (error) {
      onError(error);
    }
  }

  decode(buffer, ids, types) {
    const draco = this.module;
    const decoder = new draco.Decoder();
    const mesh = new draco.Mesh();
    const status = decoder.DecodeArrayToMesh(new Int8Array(buffer), buffer.byteLength, mesh);
    if (!status.ok()) throw new Error(status.error_msg());
    const geometry = new BufferGeometry();
    const bytes = mesh.num_faces() * 12;
    const pointer = draco._malloc(bytes);
    decoder.GetTrianglesUInt32Array(mesh, bytes, pointer);
    const index = new Uint32Array(draco.HEAPU8.buffer, pointer, mesh.num_faces() * 3).slice();
    draco._free(pointer);
    geometry.setIndex(new BufferAttribute(index, 1));
    for (const [name, id] of Object.entries(ids)) {
      const attribute = decoder.GetAttributeByUniqueId(mesh, id);
      const Type = { Float32Array, Uint32Array, Uint16Array, Uint8Array, Int16Array, Int8Array }[types[name]];
      const kind = draco["DT_" + types[name].replace("Array", "").toUpperCase()];
      const count = mesh.num_points() * attribute.num_components();
      const size = count * Type.BYTES_PER_ELEMENT;
      const at = draco._malloc(size);
      decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, kind, size, at);
      const values = new Type(draco.HEAPU8.buffer, at, count).slice();
      draco._free(at);
      geometry.setAttribute(name, new BufferAttribute(values, attribute.num_components()));
    }
    return geometry;
  }
}

// Images are not what is tested here, and node has no decoder for them.
const withoutImages = () => ({ name: "without images", loadTexture: async () => new Texture() });

const loader = new GLTFLoader();
loader.setDRACOLoader(new DracoLoader());
loader.setMeshoptDecoder(MeshoptDecoder);
loader.register(withoutImages);

// Every mesh of the file, shown or not, as a list of primitives; arrays are float32 (indices uint32) in base64.
async function describe(gltf) {
  const made = { skinned: 0, meshes: [] };
  gltf.scene.traverse((object) => (made.skinned += object.isSkinnedMesh ? 1 : 0));
  for (const [number, object] of (await gltf.parser.getDependencies("mesh")).entries()) {
    made.meshes[number] = (object.isGroup ? object.children : [object]).map(primitive);
  }
  return { ...made, poses: [-1, ...gltf.animations.slice(0, POSES).keys()].map((clip) => pose(gltf, clip)) };
}

function primitive({ isMesh, geometry }) {
  const { index, attributes, morphAttributes } = geometry;
  const count = attributes.position.count;
  const corners = Array.from({ length: index?.count ?? count }, (_, i) => index?.getX(i) ?? i);
  // Primitives may share the vertices of a whole file: only those in use are printed.
  const used = [...new Set(corners)];
  const place = new Map(used.map((vertex, i) => [vertex, i]));
  const kept = ["position", "skinIndex", "skinWeight"].filter((name) => name in attributes);
  return {
    triangles: Boolean(isMesh),
    indices: base64(Uint32Array.from(corners, (vertex) => place.get(vertex))),
    ...Object.fromEntries(kept.map((name) => [name, base64(components(attributes[name], used))])),
    targets: (morphAttributes.position ?? []).map((target) => base64(components(target, used))),
  };
}

// As three.js shows them to a shader: dequantised, and without gaps.
function components(attribute, vertices) {
  const width = attribute.itemSize;
  return Float32Array.from({ length: vertices.length * width }, (_, i) =>
    attribute.getComponent(vertices[Math.floor(i / width)], i % width),
  );
}

const base64 = (array) => Buffer.from(array.buffer).toString("base64");

// The corners of the box around every vertex, moved by morph targets, joints and nodes, halfway through a clip.
function pose(gltf, clip) {
  const mixer = new AnimationMixer(gltf.scene);
  const playing = gltf.animations[clip];
  if (playing) {
    mixer.clipAction(playing).play();
    mixer.setTime(playing.duration / 2);
  }
  gltf.scene.updateMatrixWorld(true);
  const box = new Box3();
  const point = new Vector3();
  gltf.scene.traverse((object) => {
    if (!object.isMesh || object.isInstancedMesh) return;
    if (object.isSkinnedMesh) object.skeleton.update();
    for (let i = 0; i < object.geometry.attributes.position.count; i++) {
      box.expandByPoint(object.getVertexPosition(i, point).applyMatrix4(object.matrixWorld));
    }
  });
  mixer.stopAllAction();
  return [box.min.toArray(), box.max.toArray()];
}

const result = {};
for (const path of process.argv.slice(2)) {
  const data = await readFile(path);
  try {
    const bytes = data.buffer.slice(data.byteOffset, data.byteOffset + data.length);
    const gltf = await loader.parseAsync(bytes, `${pathToFileURL(dirname(path))}/`);
    result[path] = await describe(gltf);
  } catch (error) {
    result[path] = { error: String(error) };
  }
}
console.log(JSON.stringify(result));
