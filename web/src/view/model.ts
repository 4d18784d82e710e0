/** A model as the viewer holds it: its meshes by number, and a way to let all of it go. */

import {
  Box3,
  Material,
  Texture,
  Vector3,
  type AnimationClip,
  type BufferGeometry,
  type Mesh,
  type Object3D,
  type SkinnedMesh,
} from "three";
import { corners } from "../measure/weld";

export interface Model {
  root: Object3D;
  /** In file order, so that a number names the same mesh before and after refinement. */
  meshes: Mesh[];
  clips: AnimationClip[];
}

export function modelOf(root: Object3D, clips: AnimationClip[]): Model {
  root.updateMatrixWorld(true);
  const meshes: Mesh[] = [];
  root.traverse((object) => {
    const mesh = object as Mesh;
    // What is instanced stands there as its copies.
    if (!mesh.isMesh || "isInstancedMesh" in mesh) return;
    meshes.push(mesh);
    mesh.userData.material = mesh.material;
    // Skins and morphs leave the box at rest; a mesh cut off at the edge is worse than one drawn.
    if ((mesh as SkinnedMesh).isSkinnedMesh || mesh.morphTargetInfluences) mesh.frustumCulled = false;
  });
  return { root, meshes, clips };
}

/** Whether all positions are numbers: a file may hold others, and nothing can draw them. */
export function isFinite(model: Model): boolean {
  return model.meshes.every(({ geometry }) => {
    const position = geometry.getAttribute("position");
    for (let i = 0; i < position.count; i++) {
      if (!Number.isFinite(position.getX(i) + position.getY(i) + position.getZ(i))) return false;
    }
    return true;
  });
}

/** The room that a model takes. */
export interface Extent {
  box: Box3;
  /** Every vertex, three numbers each. */
  points: Float32Array;
}

/** Vertex by vertex, as skins and morph targets place them now: a target at rest takes no room, nor does what no face has. */
export function extentOf(model: Model): Extent {
  const box = new Box3();
  const used = model.meshes.map(({ geometry }) => verticesOf(geometry));
  const count = used.reduce((sum, { length }) => sum + length, 0);
  const points = new Float32Array(3 * count);
  const place = new Vector3();
  let at = 0;
  for (const [number, mesh] of model.meshes.entries()) {
    mesh.updateWorldMatrix(true, false);
    for (const vertex of used[number]!) {
      mesh.getVertexPosition(vertex, place).applyMatrix4(mesh.matrixWorld).toArray(points, at);
      box.expandByPoint(place);
      at += 3;
    }
  }
  return { box, points };
}

/** The vertices of a geometry's faces, each once. */
function verticesOf(geometry: BufferGeometry): Uint32Array {
  const isUsed = new Uint8Array(geometry.getAttribute("position").count);
  const at = corners(geometry);
  for (let corner = 0; corner < at.length; corner++) isUsed[at[corner]!] = 1;
  return Uint32Array.from(isUsed.keys()).filter((vertex) => isUsed[vertex]);
}

/** Give back all that the graphics card holds for a model. */
export function dispose(model: Model): void {
  const geometries = new Set<BufferGeometry>();
  const materials = new Set<Material>();
  model.root.traverse((object) => {
    const mesh = object as SkinnedMesh;
    if (mesh.geometry) geometries.add(mesh.geometry);
    for (const material of [mesh.material, mesh.userData.material as Mesh["material"]].flat()) {
      if (material instanceof Material && !material.userData.shared) materials.add(material);
    }
    if (mesh.isSkinnedMesh) mesh.skeleton.dispose();
  });
  geometries.forEach((geometry) => geometry.dispose());
  for (const material of materials) {
    for (const value of Object.values(material)) {
      if (value instanceof Texture) {
        value.dispose();
        (value.image as { close?: () => void } | null)?.close?.();
      }
    }
    material.dispose();
  }
  model.root.removeFromParent();
}
