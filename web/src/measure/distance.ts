/**
 * How far each refined vertex lies from its counterpart by Loop's rules. Both have the same faces in the same
 * order; their vertices may differ, since those at a crease are one for each of its sides where normals break there.
 */

import { Box3, Matrix4, Vector3, type BufferAttribute, type Mesh, type SkinnedMesh } from "three";
import type { Result } from "../result";
import type { Model } from "../view/model";
import { corners } from "./weld";

export interface Field {
  /** One value a vertex, by mesh. */
  values: Float32Array[];
  max: number;
}

/** Distances in the scene's units; null where the two are no counterparts. */
export function distances({ model: ours, asked }: Result, { model: loop }: Result): Field | null {
  // Where faces are made as they are needed, each side has its own.
  if (asked.settings.faces !== null) return null;
  if (ours.meshes.length !== loop.meshes.length) return null;
  const values: Float32Array[] = [];
  let max = 0;
  const apart = new Vector3();
  for (const [number, mesh] of ours.meshes.entries()) {
    const counterpart = loop.meshes[number]!.geometry;
    const a = mesh.geometry.getAttribute("position");
    const b = counterpart.getAttribute("position");
    const [of, by] = [corners(mesh.geometry), corners(counterpart)];
    if (of.length !== by.length) return null;
    const toScene = placement(mesh);
    const lengths = new Float32Array(a.count);
    const isMeasured = new Uint8Array(a.count);
    for (let corner = 0; corner < of.length; corner++) {
      const [i, j] = [of[corner]!, by[corner]!];
      if (isMeasured[i]) continue;
      isMeasured[i] = 1;
      apart.set(a.getX(i) - b.getX(j), a.getY(i) - b.getY(j), a.getZ(i) - b.getZ(j));
      lengths[i] = apart.applyMatrix4(toScene).length();
      max = Math.max(max, lengths[i]!);
    }
    values.push(lengths);
  }
  return { values, max };
}

/** By how much distances between refined vertices may be wrong, in the scene's units: a file has its positions in float32. */
export function rounding({ meshes }: Model): number {
  const box = new Box3();
  const reaches = meshes.map((mesh) => {
    const { min, max } = box.setFromBufferAttribute(mesh.geometry.getAttribute("position") as BufferAttribute);
    const reach = Math.max(...[...min, ...max].map(Math.abs));
    return reach * placement(mesh).getMaxScaleOnAxis();
  });
  // Half a step along each axis, at either end.
  return Math.sqrt(3) * 2 ** -23 * reaches.reduce((a, b) => Math.max(a, b), 0);
}

/** The linear part of what places a mesh at rest; a skin is placed by its joints, not its node. */
export function placement(mesh: Mesh): Matrix4 {
  const { isSkinnedMesh, skeleton } = mesh as SkinnedMesh;
  const [bone, inverse] = isSkinnedMesh ? [skeleton.bones[0], skeleton.boneInverses[0]] : [];
  const whole =
    bone && inverse ? bone.matrixWorld.clone().multiply(inverse) : mesh.matrixWorld.clone();
  return whole.setPosition(0, 0, 0);
}

/** A length of each of the file's meshes, in its own units, as the largest in the scene's. */
export function largestLength(model: Model, ofMesh: (index: number) => number): number {
  const lengths = model.meshes.map((mesh) => ofMesh(mesh.userData.pnsMesh as number) * placement(mesh).getMaxScaleOnAxis());
  return lengths.reduce((a, b) => Math.max(a, b), 0);
}
