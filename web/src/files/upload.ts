/** Documents and the files beside them, as they were dropped or chosen. */

import type { Body } from "../api/jobs";
import { fileProblem } from "../api/problem";
import { listed } from "../report/format";
import { filesNamedIn } from "./gltf";
import { ALIASES, kindOf, MEDIA_TYPES, type Kind } from "./kinds";
import { folderOf, leadsTo, libraryPaths, shortest } from "./path";
import { textOf } from "./text";

/** A file with the folder that it came in. */
export interface PathedFile {
  path: string;
  file: File;
}

export interface Upload {
  name: string;
  /** With the folder that it came in. */
  path: string;
  kind: Kind;
  file: Blob;
  /** The files that it names, by path relative to it. */
  neighbours: Map<string, Blob>;
  bytes: number;
}

/** The files of one drop. */
export interface Dropped {
  /** Each document by itself; at least one. */
  uploads: Upload[];
  /** The names of files that are no part of any. */
  unused: string[];
}

// What is opened first: a document before an archive, and before a mesh without materials.
const ORDER: Kind[] = ["gltf", "glb", "zip", "obj", "ply", "stl", "off", "3mf"];
// Files that operating systems leave beside others.
const HIDDEN = /(^|\/)(\.|__MACOSX\/|Thumbs\.db$|desktop\.ini$)/i;

const LIBRARY = /^[ \t]*mtllib[ \t]+(.+)$/gm;
// Options of a texture stand before its name.
const TEXTURE =
  /^[ \t]*(?:map_\w+|bump|norm|disp|decal|refl)[ \t]+(?:-(?:o|s|t|mm)(?:[ \t]+[-+.\d][-+.\de]*)+[ \t]+|-\w+[ \t]+\S+[ \t]+)*(.+)$/gim;

/** The documents among the files, each with those that it names. */
export async function uploadsOf(given: PathedFile[]): Promise<Dropped> {
  const files = given.filter(({ path }) => !HIDDEN.test(path));
  const documents = files
    .map((file) => ({ ...file, kind: kindOf(file.path) }))
    .filter((file): file is PathedFile & { kind: Kind } => file.kind !== null)
    .sort((a, b) => ORDER.indexOf(a.kind) - ORDER.indexOf(b.kind) || depth(a) - depth(b));
  if (!documents.length) {
    const names = listed(given.map(({ file }) => file.name)) || "Nothing";
    const kinds = [...ORDER, ...Object.keys(ALIASES)].map((kind) => `.${kind}`);
    throw fileProblem(
      "Format not supported",
      `${names}: the page takes ${kinds.join(", ")}. In Blender, choose File, Export, glTF 2.0: it writes a .glb.`,
    );
  }
  const used = new Set(documents.map(({ path }) => path));
  const uploads: Upload[] = [];
  for (const { path, file, kind } of documents) {
    const folder = path.slice(0, path.lastIndexOf("/") + 1);
    // A form has no place for what lies elsewhere.
    const beside = files.filter((other) => other.path.startsWith(folder));
    const neighbours = kind === "gltf" || kind === "obj" ? await namedBy(path, file, beside) : [];
    neighbours.forEach(([, beside]) => used.add(beside.path));
    uploads.push({
      name: file.name,
      path,
      kind,
      file,
      neighbours: new Map(neighbours.map(([name, beside]) => [name, beside.file])),
      bytes: neighbours.reduce((sum, [, beside]) => sum + beside.file.size, file.size),
    });
  }
  return { uploads, unused: files.filter(({ path }) => !used.has(path)).map(({ path }) => path) };
}

/** Find the files that a document names, by path relative to it: an OBJ's materials name textures in turn. */
export async function namedBy(path: string, file: Blob, files: PathedFile[]): Promise<[string, PathedFile][]> {
  const among = new Map(files.map((other) => [shortest(other.path), other]));
  const folder = shortest(path).split("/").slice(0, -1);
  const find = (name: string): PathedFile | undefined => {
    const up = /^(\.\.\/)*/.exec(name)![0].length / 3;
    const there = [...folder.slice(0, Math.max(folder.length - up, 0)), name.slice(3 * up)].join("/");
    return up <= folder.length ? among.get(there) : undefined;
  };
  const found = new Map<string, PathedFile>();
  const keep = (name: string): boolean => {
    const other = find(name);
    if (other) found.set(name, other);
    return other !== undefined;
  };
  if (kindOf(path) === "obj") await keepOfObj(file, found, keep);
  else filesNamedIn(await file.arrayBuffer()).forEach(keep);
  return [...found];
}

/** Keep the materials that an OBJ names, and the textures that these name. */
async function keepOfObj(file: Blob, found: Map<string, PathedFile>, keep: (name: string) => boolean): Promise<void> {
  for (const [, names] of textOf(await file.arrayBuffer()).matchAll(LIBRARY)) {
    for (const library of libraryPaths(names!, keep)) {
      const text = textOf(await found.get(library)!.file.arrayBuffer());
      for (const [, image] of text.matchAll(TEXTURE)) leadsTo(image!, [folderOf(library), ""], keep);
    }
  }
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
