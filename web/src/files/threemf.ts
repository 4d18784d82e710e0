/** 3MF: the triangles that are printed, placed, with the colours of their corners. */

import { BufferAttribute, BufferGeometry, Color, Matrix4, SRGBColorSpace, Vector3 } from "three";
import { unzipSync } from "three/addons/libs/fflate.module.js";

/** Its units in metres, those of a glTF. */
const METRES: Record<string, number> = {
  micron: 1e-6, millimeter: 1e-3, centimeter: 1e-2, inch: 0.0254, foot: 0.3048, meter: 1,
};
const MODEL = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";
/** Copies of copies are few bytes: so many are placed. */
const MOST_PLACED = 10_000;

/** The geometry; `userData.metres` is its unit. */
export function read3mf(bytes: ArrayBuffer): BufferGeometry {
  const files = new Map(Object.entries(unzipSync(new Uint8Array(bytes))).map(([name, data]) => [name.toLowerCase(), data]));
  const models = new Map<string, Document>();
  const xml = (name: string): Document => {
    const data = files.get(name.toLowerCase());
    if (!data) throw new Error(`the archive has no ${name}`);
    return new DOMParser().parseFromString(new TextDecoder().decode(data), "application/xml");
  };
  const named = [...xml("_rels/.rels").getElementsByTagName("Relationship")].find((one) => one.getAttribute("Type") === MODEL);
  if (!named) throw new Error("the archive names no 3D model");
  const modelAt = (path: string): Document => {
    const name = path.replace(/^\//, "");
    if (!models.has(name)) models.set(name, xml(name));
    return models.get(name)!;
  };
  const root = modelAt(named.getAttribute("Target") ?? "");
  const [points, colours]: [number[], number[]] = [[], []];
  let [isColoured, placed] = [false, 0];

  const place = (model: Document, element: Element, above: Matrix4, depth: number): void => {
    if (depth > 100) throw new Error("an object is a part of itself");
    if (++placed > MOST_PLACED) throw new Error("it has too many parts to be shown");
    const path = [...element.attributes].find(({ localName }) => localName === "path")?.value;
    const inside = path ? modelAt(path) : model;
    const id = element.getAttribute("objectid");
    const object = all(inside, "object").find((one) => one.getAttribute("id") === id);
    if (!object) throw new Error(`it has no object ${id}`);
    const matrix = above.clone().multiply(matrixOf(element.getAttribute("transform")));
    for (const component of all(object, "component")) place(inside, component, matrix, depth + 1);
    const vertices = all(object, "vertex").map((vertex) =>
      new Vector3(...["x", "y", "z"].map((axis) => Number(vertex.getAttribute(axis)))).applyMatrix4(matrix),
    );
    const groups = coloursOf(inside);
    for (const triangle of all(object, "triangle")) {
      const at = ["v1", "v2", "v3"].map((name) => Number(triangle.getAttribute(name)));
      if (!at.every((corner) => vertices[corner])) throw new Error("a triangle names a vertex that it does not have");
      const group = groups.get(triangle.getAttribute("pid") ?? object.getAttribute("pid") ?? "");
      const first = triangle.getAttribute("p1") ?? object.getAttribute("pindex") ?? "0";
      // A mirror turns a part inside out.
      for (const corner of matrix.determinant() < 0 ? [0, 2, 1] : [0, 1, 2]) {
        points.push(...vertices[at[corner]!]!.toArray());
        const colour = group?.[Number(triangle.getAttribute(`p${corner + 1}`) ?? first)];
        colours.push(...(colour?.toArray() ?? [1, 1, 1]));
        isColoured ||= Boolean(colour);
      }
    }
  };
  for (const item of all(root, "item")) {
    if (item.getAttribute("printable") !== "0") place(root, item, new Matrix4(), 0);
  }
  const geometry = new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
  if (isColoured) geometry.setAttribute("color", new BufferAttribute(new Float32Array(colours), 3));
  geometry.userData.metres = METRES[root.documentElement.getAttribute("unit") ?? "millimeter"];
  return geometry;
}

function all(within: Document | Element, name: string): Element[] {
  return [...within.getElementsByTagNameNS("*", name)];
}

/** Twelve numbers, row by row; points are rows. */
function matrixOf(text: string | null): Matrix4 {
  const matrix = new Matrix4();
  const rows = text?.trim().split(/\s+/).map(Number);
  if (rows?.length !== 12) return matrix;
  return matrix.fromArray([0, 1, 2, 3].flatMap((row) => [...rows.slice(3 * row, 3 * row + 3), row === 3 ? 1 : 0]));
}

/** The colours of each group of properties, and of materials. */
function coloursOf(model: Document): Map<string, Color[]> {
  const groups = [...all(model, "colorgroup"), ...all(model, "basematerials")];
  return new Map(
    groups.map((group) => [
      group.getAttribute("id") ?? "",
      [...group.children].map((entry) => {
        const text = entry.getAttribute("color") ?? entry.getAttribute("displaycolor") ?? "#ffffff";
        return new Color().setStyle(text.slice(0, 7), SRGBColorSpace);
      }),
    ]),
  );
}
