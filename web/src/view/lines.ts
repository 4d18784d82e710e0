/** Lines over a model: the edges of its faces, and its normals. They follow skins and morphs. */

import {
  BufferAttribute,
  BufferGeometry,
  LineBasicMaterial,
  LineSegments,
  type Material,
  MeshBasicMaterial,
  Mesh,
  SkinnedMesh,
  type InterleavedBufferAttribute,
} from "three";
import { outline } from "../files/polygons";
import { corners } from "../measure/weld";
import type { Model } from "./model";

export type Lines = Mesh | LineSegments;

type Attribute = BufferAttribute | InterleavedBufferAttribute;

/** A second mesh over the same geometry, drawn as edges, or the sides of polygons; `ghost` shows through the surface. */
export function edgesOf(model: Model, colour: string, opacity = 1, ghost = false): Lines[] {
  const look = {
    color: colour,
    transparent: opacity < 1,
    opacity,
    depthTest: !ghost,
    depthWrite: false,
    toneMapped: false,
  };
  const wires = new MeshBasicMaterial({ ...look, wireframe: true });
  const sides = new LineBasicMaterial(look);
  return model.meshes.map((mesh) =>
    mesh.userData.polygons ? sidesOf(mesh, sides) : companion(mesh, mesh.geometry, wires),
  );
}

/** A short line along each normal; `length` in the scene's units. */
export function normalsOf(model: Model, colour: string, length: number): Mesh[] {
  const made: Mesh[] = [];
  for (const mesh of model.meshes) {
    if (!mesh.geometry.getAttribute("normal")) continue;
    const scale = mesh.matrixWorld.getMaxScaleOnAxis() || 1;
    const material = new MeshBasicMaterial({ color: colour, wireframe: true, toneMapped: false });
    material.onBeforeCompile = (shader) => {
      shader.uniforms.reach = { value: length / scale };
      shader.vertexShader =
        `attribute float tip; uniform float reach;\n` +
        // Before skinning, so that the line bends with its vertex.
        shader.vertexShader.replace(
          "#include <begin_vertex>",
          "$&\ntransformed += tip * reach * normal;",
        );
    };
    material.customProgramCacheKey = () => "normals";
    const lines = companion(mesh, needles(mesh.geometry), material);
    lines.userData.ownsGeometry = true;
    made.push(lines);
  }
  return made;
}

export function removeLines(lines: Lines[]): void {
  for (const line of lines) {
    line.removeFromParent();
    (line.material as Material).dispose();
    if (line.userData.ownsGeometry) line.geometry.dispose();
  }
}

function companion(mesh: Mesh, geometry: BufferGeometry, material: MeshBasicMaterial): Mesh {
  const skinned = mesh as SkinnedMesh;
  let copy: Mesh;
  if (skinned.isSkinnedMesh) {
    copy = new SkinnedMesh(geometry, material);
    (copy as SkinnedMesh).bind(skinned.skeleton, skinned.bindMatrix);
    (copy as SkinnedMesh).bindMode = skinned.bindMode;
  } else {
    copy = new Mesh(geometry, material);
  }
  // One array for both: whatever moves the mesh moves its lines.
  if (mesh.morphTargetInfluences) copy.morphTargetInfluences = mesh.morphTargetInfluences;
  copy.frustumCulled = mesh.frustumCulled;
  return over(mesh, copy);
}

/** The sides of polygons; a mesh that has them neither bends nor morphs. */
function sidesOf(mesh: Mesh, material: LineBasicMaterial): LineSegments {
  const { geometry } = mesh;
  // A copy: with a geometry its attributes leave the graphics card.
  const drawn = new BufferGeometry()
    .setAttribute("position", geometry.getAttribute("position").clone())
    .setIndex(new BufferAttribute(outline(corners(geometry)), 1));
  const lines = new LineSegments(drawn, material);
  lines.userData.ownsGeometry = true;
  return over(mesh, lines);
}

function over<T extends Lines>(mesh: Mesh, lines: T): T {
  lines.renderOrder = 1;
  lines.userData.isLines = true;
  mesh.add(lines);
  return lines;
}

/** Each vertex twice, foot and tip, and a flat triangle between: drawn as edges it is one line. */
function needles(geometry: BufferGeometry): BufferGeometry {
  const made = new BufferGeometry();
  for (const [name, attribute] of Object.entries(geometry.attributes)) {
    if (/^(position|normal|skin(Index|Weight))$/.test(name)) {
      made.setAttribute(name, doubled(attribute as Attribute));
    }
  }
  for (const [name, targets] of Object.entries(geometry.morphAttributes)) {
    made.morphAttributes[name as "position"] = (targets ?? []).map((target) => doubled(target));
  }
  made.morphTargetsRelative = geometry.morphTargetsRelative;
  const count = geometry.getAttribute("position").count;
  const tip = new Float32Array(2 * count);
  const index = new Uint32Array(3 * count);
  for (let i = 0; i < count; i++) {
    tip[2 * i + 1] = 1;
    index.set([2 * i, 2 * i + 1, 2 * i + 1], 3 * i);
  }
  return made
    .setAttribute("tip", new BufferAttribute(tip, 1))
    .setIndex(new BufferAttribute(index, 1));
}

function doubled(attribute: Attribute): BufferAttribute {
  const width = attribute.itemSize;
  const values = new Float32Array(2 * width * attribute.count);
  for (let i = 0; i < attribute.count; i++) {
    for (let k = 0; k < width; k++) {
      values[2 * width * i + k] = values[2 * width * i + width + k] = attribute.getComponent(i, k);
    }
  }
  return new BufferAttribute(values, width);
}
