/** Objects that know which of the file's meshes they are of: reports speak of those. */

import type { GLTFLoaderPlugin, GLTFParser } from "three/addons/loaders/GLTFLoader.js";

/**
 * The number is in an object's data, and so in every copy that the loader makes of it. Its own
 * account, `associations`, keeps of several scenes one alone.
 */
export function numbered(parser: GLTFParser): GLTFLoaderPlugin {
  return {
    name: "numbered",
    async loadMesh(index) {
      const object = await parser.loadMesh(index);
      object.traverse(({ userData }) => (userData.pnsMesh = index));
      return object;
    },
  };
}
