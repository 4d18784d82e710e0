/**
 * How far each refined vertex lies from its counterpart by Loop's rules. Both have the same faces in the same
 * order; their vertices may differ, since those at a crease are one for each of its sides where normals break there.
 */

import { Box3, Matrix4, Triangle, Vector3, type BufferAttribute, type BufferGeometry, type Mesh, type SkinnedMesh } from "three";
import { goesOn } from "../files/polygons";
import type { Model } from "../view/model";
import { corners } from "./weld";

type Position = ReturnType<BufferGeometry["getAttribute"]>;

export interface Field {
  /** One value a vertex, by mesh. */
  values: Float32Array[];
  max: number;
}

/** Distances in the scene's units; null where the two are no counterparts. */
export function distances(ours: Model, loop: Model): Field | null {
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

/**
 * The largest distance of a refined vertex from the faces of the file that it was made in, in the scene's units;
 * null where faces have no counterparts: those of one face follow each other, in the order of the file.
 */
export function distanceFrom(file: Model, refined: Model, levels: number): number | null {
  if (file.meshes.length !== refined.meshes.length) return null;
  let max = 0;
  const face = new Triangle();
  const [point, nearest] = [new Vector3(), new Vector3()];
  for (const [number, mesh] of refined.meshes.entries()) {
    const { geometry, userData } = file.meshes[number]!;
    const [from, to] = [geometry.getAttribute("position"), mesh.geometry.getAttribute("position")];
    const [of, by] = [corners(geometry), corners(mesh.geometry)];
    const faces = facesOf(of, from, userData.polygons === true);
    // Catmull–Clark makes a quad, two triangles, at each corner of a polygon.
    const share = (triangles: number[]): number => (userData.polygons ? (triangles.length + 2) / 2 : 1) * 4 ** levels;
    if (faces.reduce((sum, triangles) => sum + share(triangles), 0) * 3 !== by.length) return null;
    const toScene = placement(mesh);
    const lengths = new Float32Array(to.count).fill(Infinity);
    const last = new Int32Array(to.count).fill(-1);
    let begin = 0;
    for (const [index, triangles] of faces.entries()) {
      const end = begin + 3 * share(triangles);
      for (; begin < end; begin++) {
        const vertex = by[begin]!;
        if (last[vertex] === index) continue;
        last[vertex] = index;
        point.fromBufferAttribute(to, vertex).applyMatrix4(toScene);
        for (const corner of triangles) {
          for (const [end, at] of [face.a, face.b, face.c].entries()) {
            at.fromBufferAttribute(from, of[corner + end]!).applyMatrix4(toScene);
          }
          lengths[vertex] = Math.min(lengths[vertex]!, face.closestPointToPoint(point, nearest).distanceTo(point));
        }
      }
    }
    max = lengths.reduce((a, b) => (b < Infinity ? Math.max(a, b) : a), max);
  }
  return max;
}

/** The faces that are refined, each as where the corners of its triangles begin: empty ones are dropped. */
function facesOf(of: ArrayLike<number>, at: Position, polygons: boolean): number[][] {
  const faces: number[][] = [];
  const place = (corner: number): string => [at.getX(of[corner]!), at.getY(of[corner]!), at.getZ(of[corner]!)].join();
  for (let begin = 0; begin + 2 < of.length; begin += 3) {
    if (polygons && goesOn(of, begin)) faces.at(-1)!.push(begin);
    else if (polygons || new Set([place(begin), place(begin + 1), place(begin + 2)]).size === 3) faces.push([begin]);
  }
  return faces;
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
