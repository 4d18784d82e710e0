/** glTF into a scene, with no request to anywhere but the files at hand. */

import { GLTFLoader, type GLTF } from "three/addons/loaders/GLTFLoader.js";
import { part } from "../api/part";
import { fileProblem } from "../api/problem";
import { spread } from "./instances";
import { localFiles } from "./local";
import { numbered } from "./numbered";
import { pathOf } from "./path";
import { unreadable } from "./unreadable";
import { whole } from "./whole";

export interface GltfJson {
  asset?: { extras?: { pns?: unknown } };
  extensionsUsed?: string[];
  accessors?: { count: number }[];
  nodes?: { children?: number[] }[];
  meshes?: {
    name?: string;
    extras?: { targetNames?: string[] };
    primitives: { mode?: number; indices?: number; attributes: Record<string, number> }[];
  }[];
}

const MAGIC = 0x46546c67;

/** The JSON of a .glb or a .gltf. Throws where it is none. */
export function jsonOf(bytes: ArrayBuffer): GltfJson {
  const view = new DataView(bytes);
  const isBinary = bytes.byteLength >= 20 && view.getUint32(0, true) === MAGIC;
  const text = isBinary ? new Uint8Array(bytes, 20, view.getUint32(12, true)) : bytes;
  const json = JSON.parse(new TextDecoder().decode(text)) as GltfJson | null;
  if (!json?.asset) throw new Error("it names no version");
  return json;
}

/** The paths of the files that a document names; what is no JSON names none. */
export function filesNamedIn(bytes: ArrayBuffer): Set<string> {
  const paths = new Set<string>();
  try {
    JSON.parse(new TextDecoder().decode(bytes), (key, value: unknown) => {
      if (key === "uri" && typeof value === "string" && !/^(data|blob):/.test(value)) paths.add(pathOf(value));
      return value;
    });
  } catch {
    // It is refused when it is opened.
  }
  return paths;
}

/** Triangles of all meshes, each counted once however many nodes show it. */
export function triangles(json: GltfJson): number {
  let count = 0;
  for (const mesh of json.meshes ?? []) {
    for (const { mode = 4, indices, attributes } of mesh.primitives) {
      const corners = json.accessors?.[indices ?? attributes.POSITION ?? -1]?.count ?? 0;
      if (mode === 4) count += Math.floor(corners / 3);
      if (mode === 5 || mode === 6) count += Math.max(corners - 2, 0);
    }
  }
  return count;
}

/** Parse a glTF; `neighbours` are the files that it may name, `missing` gets those that are not among them. */
export async function parseGltf(
  bytes: ArrayBuffer,
  neighbours: Map<string, Blob> = new Map(),
  missing = new Set<string>(),
): Promise<GLTF> {
  const { manager, release } = localFiles((url) => neighbours.get(pathOf(url)), missing);
  const loader = new GLTFLoader(manager).register(numbered).register(whole);
  const json = jsonOf(bytes);
  const used = json.extensionsUsed ?? [];
  if (used.includes("EXT_meshopt_compression") || used.includes("KHR_meshopt_compression")) {
    const { MeshoptDecoder } = await part(import("three/addons/libs/meshopt_decoder.module.js"));
    await MeshoptDecoder.ready;
    loader.setMeshoptDecoder(MeshoptDecoder);
  }
  const draco = used.includes("KHR_draco_mesh_compression") ? await dracoLoader() : null;
  if (draco) loader.setDRACOLoader(draco);
  if (used.includes("KHR_texture_basisu")) {
    const { ktx2Loader } = await part(import("./ktx2"));
    loader.setKTX2Loader(await ktx2Loader((url) => manager.resolveURL(url)));
  }
  try {
    const gltf = await loader.parseAsync(bytes, "");
    spread(gltf.scene);
    return gltf;
  } catch (error) {
    if (missing.size) {
      throw fileProblem(
        "A file is missing",
        `The document names ${[...missing].join(", ")}: drop it together with the .gltf, or as a .zip.`,
      );
    }
    throw unreadable("readable glTF", error);
  } finally {
    draco?.dispose();
    release();
  }
}

async function dracoLoader() {
  const { DRACOLoader } = await part(import("three/addons/loaders/DRACOLoader.js"));
  const at = (path: string): string => new URL(path, import.meta.url).href;
  const loader = new DRACOLoader();
  // The types know a folder alone; a pair of addresses is taken too, and ours carry hashes.
  loader.setDecoderPath({ js: at(DRACO_WRAPPER), wasm: at(DRACO_WASM) } as unknown as string);
  return loader;
}
