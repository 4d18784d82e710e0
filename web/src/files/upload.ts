/** Documents and the files beside them, as they were dropped or chosen. */

import type { Body } from "../api/jobs";
import { fileProblem } from "../api/problem";
import { listed } from "../report/format";
import { filesNamedIn } from "./gltf";
import { ALIASES, kindOf, MEDIA_TYPES, type Kind } from "./kinds";
import { shortest } from "./path";

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
  const names = kindOf(path) === "obj" ? await namesInObj(file, find) : filesNamedIn(await file.arrayBuffer());
  return [...names].flatMap((name) => {
    const other = find(name);
    return other ? [[name, other] as [string, PathedFile]] : [];
  });
}

async function namesInObj(file: Blob, find: (name: string) => PathedFile | undefined): Promise<Set<string>> {
  const named = async (text: Promise<string>, statement: RegExp): Promise<string[]> =>
    [...(await text).matchAll(statement)].map(([, name]) => shortest(name!.trim()));
  const libraries = await named(file.text(), /^[ \t]*mtllib[ \t]+(.+)$/gm);
  const textures = libraries.map((name) => {
    const library = find(name);
    // Options of a texture stand before its name.
    return library ? named(library.file.text(), /^[ \t]*(?:map_\w+|bump|norm|disp|decal)[ \t]+(?:.*[ \t])?(\S+)[ \t]*$/gm) : [];
  });
  return new Set([...libraries, ...(await Promise.all(textures)).flat()]);
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
