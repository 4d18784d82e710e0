/** A .zip opened in the page: one .gltf or .glb, and the files that it names. */

import { unzip as inflate, type Unzipped } from "three/addons/libs/fflate.module.js";
import { fileProblem } from "../api/problem";
import { kindOf } from "./kinds";
import { shortest } from "./path";
import { unreadable } from "./unreadable";
import { namedBy, uploadsOf, type PathedFile, type Upload } from "./upload";

export async function unzip(upload: Upload): Promise<Pick<Upload, "file" | "neighbours">> {
  const data = new Uint8Array(await upload.file.arrayBuffer());
  const entries = await new Promise<Unzipped>((resolve, reject) =>
    inflate(data, (error, files) => (error ? reject(unreadable("ZIP", error)) : resolve(files))),
  );
  const paths = Object.keys(entries).filter((path) => !path.endsWith("/"));
  if (!paths.some((path) => /^gl(b|tf)$/.test(kindOf(path) ?? ""))) {
    const names = paths.slice(0, 5).join(", ") || "nothing";
    throw fileProblem("No glTF in this archive", `It holds ${names}: the page takes a .gltf or .glb in a .zip.`);
  }
  const files = paths.map((path): PathedFile => ({
    path: shortest(path),
    file: new File([entries[path] as BlobPart], path),
  }));
  const { uploads } = await uploadsOf(files);
  // A glTF comes first, and the service refuses an archive that holds several.
  const { path, file } = uploads[0]!;
  // In an archive it may name what lies outside of its folder.
  const named = await namedBy(path, file, files);
  return { file, neighbours: new Map(named.map(([name, other]) => [name, other.file])) };
}
