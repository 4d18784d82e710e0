/** A dropped file as a scene: what stands before refinement. */

import { Group, Mesh, type AnimationClip, type BufferGeometry } from "three";
import { fileProblem } from "../api/problem";
import { plain } from "../view/looks";
import { hasNormals, jsonOf, parseGltf, triangles, type GltfJson } from "./gltf";
import type { Upload } from "./upload";

export interface Opened {
  scene: Group;
  clips: AnimationClip[];
  /** Faces that refinement starts from; an upper bound, since empty ones are dropped. */
  faces: number;
  /** Whether the file says how its surface is shaded. */
  normals: boolean;
  /** null where the file is no glTF. */
  json: GltfJson | null;
  /** The bytes that a glTF validator reads; null where the file is no glTF. */
  gltf: { bytes: ArrayBuffer; neighbours: Map<string, Blob> } | null;
}

export async function open(upload: Upload): Promise<Opened> {
  if (!upload.file.size) throw fileProblem("The file is empty", `${upload.name} holds not one byte.`);
  if (upload.kind === "zip") {
    const { unzip } = await import("./archive");
    const inside = await unzip(upload);
    return openGltf(await inside.file.arrayBuffer(), inside.neighbours);
  }
  const bytes = await upload.file.arrayBuffer();
  if (upload.kind === "glb" || upload.kind === "gltf") return openGltf(bytes, upload.neighbours);
  const { readMesh } = await import("./meshes");
  let geometry: BufferGeometry;
  try {
    geometry = readMesh(bytes, upload.kind);
  } catch (error) {
    throw unreadable(upload, error);
  }
  const mesh = new Mesh(geometry);
  plain([mesh]);
  const scene = new Group().add(mesh);
  const corners = geometry.index?.count ?? geometry.getAttribute("position").count;
  return { scene, clips: [], faces: Math.floor(corners / 3), normals: false, json: null, gltf: null };
}

async function openGltf(bytes: ArrayBuffer, neighbours: Map<string, Blob>): Promise<Opened> {
  let json: GltfJson;
  try {
    json = jsonOf(bytes);
  } catch {
    throw fileProblem("The file cannot be read", "It is neither a GLB nor glTF JSON.");
  }
  const { scene, animations } = await parseGltf(bytes, neighbours);
  return {
    scene,
    clips: animations,
    faces: triangles(json),
    normals: hasNormals(json),
    json,
    gltf: { bytes, neighbours },
  };
}

function unreadable(upload: Upload, error: unknown): Error {
  const kind = upload.kind.toUpperCase();
  // What a reader of binary data says where it runs over the end means nothing to anybody.
  const why = error instanceof RangeError ? "it ends too early" : (error as Error).message;
  return fileProblem("The file cannot be read", `This is no ${kind}: ${why}`);
}
