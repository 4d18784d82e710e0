/** What is shown of a glTF that has no scene. */

import { Group, type Object3D } from "three";
import type { GLTFLoaderPlugin, GLTFParser } from "three/addons/loaders/GLTFLoader.js";
import type { GltfJson } from "./gltf";

/** A scene of all its nodes; where it has none, of its meshes. */
export function whole(parser: GLTFParser): GLTFLoaderPlugin {
  return {
    name: "whole",
    async afterRoot(result) {
      if (result.scene) return;
      const { nodes = [] } = parser.json as GltfJson;
      const inside = new Set(nodes.flatMap(({ children = [] }) => children));
      const roots = [...nodes.keys()].filter((node) => !inside.has(node));
      const objects: Object3D[] = nodes.length
        ? await Promise.all(roots.map((node) => parser.getDependency("node", node)))
        : await parser.getDependencies("mesh");
      result.scene = new Group();
      for (const object of objects) result.scene.add(object);
    },
  };
}
