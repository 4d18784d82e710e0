/** The materials of an OBJ, from the libraries beside it. */

import { MeshStandardMaterial, type Material, type MeshPhongMaterial } from "three";
import { MTLLoader } from "three/addons/loaders/MTLLoader.js";
import { plainMaterial } from "../view/looks";
import { localFiles } from "./local";
import type { ObjMaterials } from "./obj";
import { folderOf, leadsTo, libraryPaths } from "./path";
import { textOf } from "./text";

/** Make a material for each name, once its textures are there; `missing` gets the files that did not come. */
export async function objMaterials(
  { names, libraries }: ObjMaterials,
  neighbours: Map<string, Blob>,
  missing: Set<string>,
): Promise<Material[]> {
  const made = new Map<string, MeshPhongMaterial>();
  const has = (path: string): boolean => neighbours.has(path);
  for (const library of libraries) {
    const paths = libraryPaths(library, has);
    if (!paths.length) missing.add(library);
    for (const path of paths) {
      const find = (url: string): Blob | undefined => neighbours.get(leadsTo(url, [folderOf(path), ""], has) ?? "");
      const { manager, release } = localFiles(find, missing);
      let loads = 0;
      const loaded = new Promise<void>((resolve) => (manager.onLoad = resolve));
      manager.onStart = () => loads++;
      const text = textOf(await neighbours.get(path)!.arrayBuffer());
      const creator = new MTLLoader(manager).parse(text.replaceAll("\t", " "), "");
      for (const name of names) {
        if (name in creator.materialsInfo) made.set(name, creator.create(name) as MeshPhongMaterial);
      }
      if (loads) await loaded;
      release();
    }
  }
  return names.map((name) => {
    const material = made.get(name);
    if (!material) return plainMaterial();
    const { color, map, opacity, transparent } = material;
    return new MeshStandardMaterial({ name, color, map, opacity, transparent, roughness: 0.7, flatShading: true });
  });
}
