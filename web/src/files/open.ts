/** A dropped file as a scene: what stands before refinement. */

import { Group, Mesh, type AnimationClip, type BufferGeometry } from "three";
import { part } from "../api/part";
import { fileProblem } from "../api/problem";
import { plain } from "../view/looks";
import { corners } from "../measure/weld";
import { jsonOf, parseGltf, triangles, type GltfJson } from "./gltf";
import type { ObjMaterials } from "./obj";
import { countPolygons } from "./polygons";
import { unreadable } from "./unreadable";
import type { Upload } from "./upload";

export interface Opened {
  scene: Group;
  clips: AnimationClip[];
  /** Faces that refinement starts from; an upper bound, since empty ones are dropped. */
  faces: number;
  /** Faces after one step: four of a triangle, but one for each corner where other polygons are. */
  split: number;
  /** Whether it has faces of more corners than three. */
  polygons: boolean;
  /** Files that it names and that did not come with it: textures, as it cannot be opened without others. */
  missing: string[];
  /** null where the file is no glTF. */
  json: GltfJson | null;
  /** The bytes that a glTF validator reads; null where the file is no glTF. */
  gltf: { bytes: ArrayBuffer; neighbours: Map<string, Blob> } | null;
}

export async function open(upload: Upload): Promise<Opened> {
  if (!upload.file.size) throw fileProblem("The file is empty", `${upload.name} holds not one byte.`);
  if (upload.kind === "zip") {
    const { unzip } = await part(import("./archive"));
    const inside = await unzip(upload);
    return openGltf(await inside.file.arrayBuffer(), inside.neighbours);
  }
  const bytes = await upload.file.arrayBuffer();
  if (upload.kind === "glb" || upload.kind === "gltf") return openGltf(bytes, upload.neighbours);
  const { readMesh } = await part(import("./meshes"));
  let geometry: BufferGeometry;
  try {
    geometry = readMesh(bytes, upload.kind);
  } catch (error) {
    throw unreadable(upload.kind.toUpperCase(), error);
  }
  const mesh = new Mesh(geometry);
  plain([mesh]);
  // As the service's GLB has it: z upwards becomes y, and lengths are metres.
  const { metres } = geometry.userData as { metres?: number };
  if (metres) {
    mesh.rotation.x = -Math.PI / 2;
    mesh.scale.setScalar(metres);
  }
  const missing = new Set<string>();
  const { libraries = [] } = geometry.userData as Partial<ObjMaterials>;
  if (libraries.length) {
    const { objMaterials } = await part(import("./materials"));
    mesh.material = await objMaterials(geometry.userData as ObjMaterials, upload.neighbours, missing);
  }
  const scene = new Group().add(mesh);
  const triangles = Math.floor(corners(geometry).length / 3);
  const faces = countPolygons(corners(geometry));
  const polygons = faces < triangles;
  mesh.userData.polygons = polygons;
  const split = polygons ? triangles + 2 * faces : 4 * triangles;
  return { scene, clips: [], faces, split, polygons, missing: [...missing], json: null, gltf: null };
}

async function openGltf(bytes: ArrayBuffer, neighbours: Map<string, Blob>): Promise<Opened> {
  let json: GltfJson;
  try {
    json = jsonOf(bytes);
  } catch {
    throw unreadable("glTF", new Error("it is neither a GLB nor JSON with an asset"));
  }
  const missing = new Set<string>();
  const { scene, animations } = await parseGltf(bytes, neighbours, missing);
  const faces = triangles(json);
  return {
    scene,
    clips: animations,
    faces,
    split: 4 * faces,
    polygons: false,
    missing: [...missing],
    json,
    gltf: { bytes, neighbours },
  };
}
