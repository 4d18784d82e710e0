/** A document and the files beside it, as they were dropped or chosen. */

import type { Body } from "../api/jobs";
import { fileProblem } from "../api/problem";
import { kindOf, MEDIA_TYPES, type Kind } from "./kinds";

/** A file with the folder that it came in. */
export interface PathedFile {
  path: string;
  file: File;
}

export interface Upload {
  name: string;
  kind: Kind;
  file: Blob;
  /** What a .gltf names, by path relative to it. */
  neighbours: Map<string, Blob>;
  bytes: number;
}

// A document first: an archive or a mesh beside it is a neighbour.
const ORDER: Kind[] = ["gltf", "glb", "zip", "obj", "ply", "stl", "off"];

/** The one document among the files. */
export function uploadOf(files: PathedFile[]): Upload {
  const documents = files
    .map((file) => ({ ...file, kind: kindOf(file.path) }))
    .filter((file): file is PathedFile & { kind: Kind } => file.kind !== null)
    .sort((a, b) => ORDER.indexOf(a.kind) - ORDER.indexOf(b.kind) || depth(a) - depth(b));
  const main = documents[0];
  if (!main) {
    const names = files.map(({ file }) => file.name).join(", ") || "nothing";
    throw fileProblem(
      "No mesh among these files",
      `${names}: the page takes ${ORDER.map((kind) => `.${kind}`).join(", ")}.`,
    );
  }
  const folder = main.path.slice(0, main.path.lastIndexOf("/") + 1);
  const beside = main.kind === "gltf" ? files.filter(({ path }) => path !== main.path) : [];
  const neighbours = new Map(
    beside.map(({ path, file }) => [path.replace(folder, ""), file as Blob]),
  );
  const bytes = [main.file, ...neighbours.values()].reduce((sum, file) => sum + file.size, 0);
  return { name: main.file.name, kind: main.kind, file: main.file, neighbours, bytes };
}

/** The body of a job. */
export function bodyOf(upload: Upload): Body {
  if (!upload.neighbours.size) return { content: upload.file, type: MEDIA_TYPES[upload.kind] };
  const form = new FormData();
  form.append("file", upload.file, upload.name);
  for (const [path, file] of upload.neighbours) form.append(path, file, path);
  return { content: form, type: "" };
}

function depth({ path }: PathedFile): number {
  return path.split("/").length;
}
