/** The copies that EXT_mesh_gpu_instancing makes, as meshes of their own. */

import { Mesh, type InstancedMesh, type Object3D } from "three";

/** Stand a mesh where each copy stands: lines, framing and measures go by meshes. */
export function spread(scene: Object3D): void {
  const instanced: InstancedMesh[] = [];
  scene.traverse((object) => {
    if ("isInstancedMesh" in object) instanced.push(object as InstancedMesh);
  });
  for (const mesh of instanced) {
    // It stays, as it may be a node that moves, and draws nothing itself.
    mesh.layers.disableAll();
    for (let number = 0; number < mesh.count; number++) {
      const copy = new Mesh(mesh.geometry, mesh.material);
      mesh.getMatrixAt(number, copy.matrix);
      copy.matrix.decompose(copy.position, copy.quaternion, copy.scale);
      copy.userData.pnsMesh = mesh.userData.pnsMesh;
      mesh.add(copy);
    }
  }
}
