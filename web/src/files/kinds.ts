/** Which files the page takes, and what the service calls them. */

export type Kind = "glb" | "gltf" | "zip" | "obj" | "ply" | "stl" | "off" | "3mf";

export const MEDIA_TYPES: Record<Kind, string> = {
  glb: "model/gltf-binary",
  gltf: "model/gltf+json",
  zip: "application/zip",
  obj: "model/obj",
  ply: "model/ply",
  stl: "model/stl",
  off: "model/off",
  "3mf": "model/3mf",
};

/** Other endings of a kind. */
export const ALIASES: Record<string, Kind> = { vrm: "glb" };

export function kindOf(name: string): Kind | null {
  const extension = /\.([^./]+)$/.exec(name)?.[1]?.toLowerCase() ?? "";
  return extension in MEDIA_TYPES ? (extension as Kind) : (ALIASES[extension] ?? null);
}
