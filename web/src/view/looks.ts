/**
 * Ways to see a surface other than its own material. All are matcap materials at heart, because
 * those carry normals, skins and morph targets, and cost no lights.
 */

import {
  CanvasTexture,
  DataTexture,
  DoubleSide,
  LinearFilter,
  MeshBasicMaterial,
  MeshMatcapMaterial,
  MeshStandardMaterial,
  SRGBColorSpace,
  type Mesh,
} from "three";
import { cividis } from "../measure/cividis";

export type Look = "material" | "clay" | "zebra" | "heat" | "wire" | "hidden";

const OUTGOING = "vec3 outgoingLight = diffuseColor.rgb * matcapColor.rgb;";

/** Values below `low` and above `high` take the colours of the ends. */
export const heatRange = { low: { value: 0 }, high: { value: 1 } };

const made = new Map<string, MeshMatcapMaterial | MeshBasicMaterial>();

/** Dress a mesh; `paper` is the colour behind it, which hides the lines at the back. */
export function dress(mesh: Mesh, look: Look, paper: string): void {
  if (look === "material") {
    mesh.material = mesh.userData.material as Mesh["material"];
    return;
  }
  const faceted = !mesh.geometry.getAttribute("normal");
  const name = `${look}${faceted ? " faceted" : ""}`;
  let material = made.get(name);
  if (!material) {
    material = MAKERS[look](faceted);
    material.side = DoubleSide;
    material.toneMapped = false;
    material.userData.shared = true;
    // Lines that lie in the surface win against it.
    Object.assign(material, { polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
    made.set(name, material);
  }
  if (look === "wire") (material as MeshBasicMaterial).color.set(paper);
  mesh.material = material;
}

/** Give meshes without materials one in which their shape, and the colours of their vertices, are seen. */
export function plain(meshes: Mesh[]): void {
  for (const mesh of meshes) {
    [mesh.material].flat().forEach((material) => material.dispose());
    const { geometry } = mesh;
    mesh.material = plainMaterial(!geometry.hasAttribute("normal"), geometry.hasAttribute("color"));
    mesh.userData.material = mesh.material;
  }
}

export function plainMaterial(flatShading = true, vertexColors = false): MeshStandardMaterial {
  const color = vertexColors ? 0xffffff : 0xb8bcc4;
  return new MeshStandardMaterial({ color, roughness: 0.7, flatShading, vertexColors });
}

const MAKERS = {
  wire: () => new MeshBasicMaterial(),
  // A hidden object would take the lines over it along; a hidden material does not.
  hidden: () => new MeshBasicMaterial({ visible: false }),
  clay: (flatShading: boolean) => new MeshMatcapMaterial({ flatShading, matcap: clay() }),
  zebra: (flatShading: boolean) =>
    patched(new MeshMatcapMaterial({ flatShading }), {
      fragment: `
        vec3 mirrored = reflect( - viewDir, normal );
        float height = 13.0 * asin( clamp( mirrored.y, -1.0, 1.0 ) ) + 4.0 * mirrored.x;
        float width = max( fwidth( height ), 1e-4 );
        float stripe = smoothstep( -width, width, sin( height ) );
        vec3 outgoingLight = vec3( mix( 0.025, 0.86, stripe ) );`,
    }),
  heat: (flatShading: boolean) =>
    patched(new MeshMatcapMaterial({ flatShading }), {
      vertexHead: "attribute float heat; varying float vHeat;",
      vertex: "vHeat = heat;",
      fragmentHead:
        "uniform sampler2D heatMap; uniform float heatLow, heatHigh; varying float vHeat;",
      // A little shade shows the form; it leaves the order of the colours as it is.
      fragment: `
        float share = clamp( ( vHeat - heatLow ) / max( heatHigh - heatLow, 1e-30 ), 0.0, 1.0 );
        vec3 colour = texture2D( heatMap, vec2( ( share * 255.0 + 0.5 ) / 256.0, 0.5 ) ).rgb;
        vec3 outgoingLight = colour * ( 0.72 + 0.28 * abs( dot( normal, viewDir ) ) );`,
      uniforms: { heatMap: { value: table() }, heatLow: heatRange.low, heatHigh: heatRange.high },
    }),
};

interface Patch {
  vertexHead?: string;
  vertex?: string;
  fragmentHead?: string;
  fragment: string;
  uniforms?: Record<string, { value: unknown }>;
}

function patched(material: MeshMatcapMaterial, patch: Patch): MeshMatcapMaterial {
  material.onBeforeCompile = (shader) => {
    Object.assign(shader.uniforms, patch.uniforms);
    shader.vertexShader =
      `${patch.vertexHead ?? ""}\n` +
      shader.vertexShader.replace("#include <begin_vertex>", `$&\n${patch.vertex ?? ""}`);
    if (!shader.fragmentShader.includes(OUTGOING)) throw new Error("three's matcap shader changed");
    shader.fragmentShader =
      `${patch.fragmentHead ?? ""}\n` + shader.fragmentShader.replace(OUTGOING, patch.fragment);
  };
  material.customProgramCacheKey = () => patch.fragment;
  return material;
}

/** Grey clay under a soft light from the upper left: a picture of a lit sphere. */
function clay(): CanvasTexture {
  const size = 256;
  const canvas = Object.assign(document.createElement("canvas"), { width: size, height: size });
  const context = canvas.getContext("2d")!;
  context.fillStyle = "#6b6d72";
  context.fillRect(0, 0, size, size);
  const light = context.createRadialGradient(96, 74, 4, 128, 128, 134);
  light.addColorStop(0, "#f4f3f0");
  light.addColorStop(0.35, "#d6d5d2");
  light.addColorStop(0.75, "#9b9ca0");
  light.addColorStop(1, "#5c5e66");
  context.fillStyle = light;
  context.fillRect(0, 0, size, size);
  const texture = new CanvasTexture(canvas);
  texture.colorSpace = SRGBColorSpace;
  return texture;
}

function table(): DataTexture {
  const texels = new Uint8Array(256 * 4);
  for (let i = 0; i < 256; i++) texels.set([...cividis(i / 255), 255], 4 * i);
  const texture = new DataTexture(texels, 256, 1);
  texture.colorSpace = SRGBColorSpace;
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
