/** How far two surfaces are apart, from each to the other, at points all over them. */

import { BufferGeometry, Float32BufferAttribute, Uint32BufferAttribute, Triangle, Vector3, type Mesh } from "three";
import type { MeshBVH } from "three-mesh-bvh";
import type { Model } from "../view/model";
import { placement } from "./distance";
import { corners } from "./weld";

/** In the scene's units. */
export interface Closeness {
  most: number;
  /** Over the area, of the side where it is larger. */
  mean: number;
}

/** Points on each of the two surfaces, and vertices of each, that are measured. */
const SAMPLES = 20_000;
/** A tree over more faces would hold up the page. */
const MOST_FACES = 600_000;
/** Milliseconds of work between two frames. */
const SLICE = 8;

interface Surface {
  geometry: BufferGeometry;
  tree: MeshBVH;
  area: number;
}

/** Measure a result and the file it was made of, mesh by mesh; null where they do not correspond or are too large. */
export async function closeness(file: Model, refined: Model, signal: AbortSignal): Promise<Closeness | null> {
  const pairs = refined.meshes.map((mesh, number) => [mesh, file.meshes[number]] as const);
  const faces = refined.meshes.reduce((sum, { geometry }) => sum + corners(geometry).length / 3, 0);
  if (!pairs.length || file.meshes.length !== pairs.length || faces > MOST_FACES) return null;
  const { MeshBVH } = await import("three-mesh-bvh");
  const surface = (mesh: Mesh): Surface => {
    const geometry = placed(mesh);
    return { geometry, tree: new MeshBVH(geometry, { indirect: true }), area: areaOf(geometry) };
  };
  const surfaces: [Surface, Surface][] = [];
  for (const [mesh, other] of pairs) {
    if (!corners(mesh.geometry).length || !corners(other!.geometry).length) continue;
    surfaces.push([surface(mesh), surface(other!)]);
    await pause(signal);
  }
  let [most, mean] = [0, 0];
  for (const [from, to] of [[0, 1], [1, 0]] as const) {
    const area = surfaces.reduce((sum, pair) => sum + pair[from].area, 0);
    const count = surfaces.reduce((sum, pair) => sum + pair[from].geometry.getAttribute("position").count, 0);
    let sum = 0;
    let rest = performance.now();
    for (const pair of surfaces) {
      for (const [point, share] of pointsOn(pair[from], area, Math.ceil(count / SAMPLES))) {
        const distance = pair[to].tree.closestPointToPoint(point)?.distance ?? 0;
        most = Math.max(most, distance);
        sum += share * distance;
        if (performance.now() - rest < SLICE) continue;
        await pause(signal);
        rest = performance.now();
      }
    }
    mean = Math.max(mean, area ? sum / area : 0);
  }
  return { most, mean };
}

/** Points on a surface, each with the area that it stands for: 0 at vertices, of which each `every`-th is taken. */
function* pointsOn({ geometry }: Surface, whole: number, every: number): Generator<[Vector3, number]> {
  const point = new Vector3();
  const position = geometry.getAttribute("position");
  for (let vertex = 0; vertex < position.count; vertex += every) yield [point.fromBufferAttribute(position, vertex), 0];
  const index = geometry.index!;
  const face = new Triangle();
  for (let corner = 0; corner < index.count; corner += 3) {
    face.setFromAttributeAndIndices(position, index.getX(corner), index.getX(corner + 1), index.getX(corner + 2));
    const area = face.getArea();
    // The middles of n² triangles of one size.
    const n = Math.max(1, Math.round(Math.sqrt((SAMPLES * area) / whole)));
    for (let i = 0; i < n; i++) {
      for (let j = 0; j < 2 * (n - i) - 1; j++) {
        const [u, v] = j % 2 ? [i + 2 / 3, (j - 1) / 2 + 2 / 3] : [i + 1 / 3, j / 2 + 1 / 3];
        point.set(0, 0, 0).addScaledVector(face.a, 1 - (u + v) / n).addScaledVector(face.b, u / n).addScaledVector(face.c, v / n);
        yield [point, area / n ** 2];
      }
    }
  }
}

/** A mesh's positions in the scene's units, at rest. */
function placed(mesh: Mesh): BufferGeometry {
  const from = mesh.geometry.getAttribute("position");
  const toScene = placement(mesh);
  const at = new Float32BufferAttribute(new Float32Array(3 * from.count), 3);
  const point = new Vector3();
  for (let i = 0; i < from.count; i++) {
    const { x, y, z } = point.fromBufferAttribute(from, i).applyMatrix4(toScene);
    at.setXYZ(i, x, y, z);
  }
  const whole = corners(mesh.geometry);
  const index = Uint32Array.from({ length: whole.length - (whole.length % 3) }, (_, corner) => whole[corner]!);
  return new BufferGeometry().setAttribute("position", at).setIndex(new Uint32BufferAttribute(index, 1));
}

function areaOf({ index, attributes: { position } }: BufferGeometry): number {
  const face = new Triangle();
  let area = 0;
  for (let corner = 0; corner < index!.count; corner += 3) {
    face.setFromAttributeAndIndices(position!, index!.getX(corner), index!.getX(corner + 1), index!.getX(corner + 2));
    area += face.getArea();
  }
  return area;
}

/** Let the page draw. Rejects where the measurement has been ended. */
async function pause(signal: AbortSignal): Promise<void> {
  await new Promise((resolve) => setTimeout(resolve));
  signal.throwIfAborted();
}
