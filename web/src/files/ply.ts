/** PLY: positions, the colours of vertices, polygons and strips of triangles. */

import { BufferAttribute, BufferGeometry, Color, SRGBColorSpace } from "three";
import { addFan } from "./polygons";

interface Property {
  name: string;
  type: string;
  /** The type of a list's length; "" for one value. */
  length: string;
}

/** Reads the next value of a type. */
type Next = (type: string) => number;

const TYPES: Record<string, [keyof DataView, number]> = {
  char: ["getInt8", 1], uchar: ["getUint8", 1], short: ["getInt16", 2], ushort: ["getUint16", 2],
  int: ["getInt32", 4], uint: ["getUint32", 4], float: ["getFloat32", 4], double: ["getFloat64", 8],
  int8: ["getInt8", 1], uint8: ["getUint8", 1], int16: ["getInt16", 2], uint16: ["getUint16", 2],
  int32: ["getInt32", 4], uint32: ["getUint32", 4], float32: ["getFloat32", 4], float64: ["getFloat64", 8],
};

export function readPly(bytes: ArrayBuffer): BufferGeometry {
  // A character a byte.
  const text = new TextDecoder("latin1").decode(bytes);
  const end = /end_header[ \t]*(\r\n|\r|\n)/.exec(text);
  if (!end) throw new Error("its header has no end");
  const begin = end.index + end[0].length;
  const lines = text.slice(0, end.index).split(/[\r\n]+/).map((line) => line.trim().split(/\s+/));
  const format = lines.find(([word]) => word === "format")?.[1] ?? "ascii";
  const next = format === "ascii" ? words(text.slice(begin)) : values(bytes, begin, format.endsWith("little_endian"));
  const [points, colours, index]: [number[], number[], number[]] = [[], [], []];
  const colour = new Color();
  for (const { name, count, properties } of elements(lines)) {
    if (!properties.length) continue;
    const typeOf = (one: string): string => properties.find((own) => own.name === one)?.type ?? "";
    const full = /^(uchar|uint8)$/.test(typeOf("red")) ? 255 : /^u/.test(typeOf("red")) ? 65535 : 1;
    for (let row = 0; row < count; row++) {
      const one = element(properties, next);
      const value = (name: string): number => one.get(name)?.[0] ?? NaN;
      if (name === "vertex") {
        points.push(value("x"), value("y"), value("z"));
        if (!one.has("red")) continue;
        colour.setRGB(value("red") / full, value("green") / full, value("blue") / full, SRGBColorSpace);
        colours.push(colour.r, colour.g, colour.b);
      }
      const corners = one.get("vertex_indices") ?? one.get("vertex_index") ?? [];
      if (name === "face") addFan(index, corners);
      if (name === "tristrips") addStrips(index, corners);
    }
  }
  if (!index.length) throw new Error("it has no faces");
  if (index.some((at) => !(at >= 0 && 3 * at < points.length))) throw new Error("a face names a vertex that it does not have");
  const geometry = new BufferGeometry()
    .setAttribute("position", new BufferAttribute(new Float32Array(points), 3))
    .setIndex(index);
  if (colours.length) geometry.setAttribute("color", new BufferAttribute(new Float32Array(colours), 3));
  return geometry;
}

function elements(lines: string[][]): { name: string; count: number; properties: Property[] }[] {
  const found: { name: string; count: number; properties: Property[] }[] = [];
  for (const [word, ...rest] of lines) {
    if (word === "element") found.push({ name: rest[0] ?? "", count: Number(rest[1]), properties: [] });
    if (word !== "property") continue;
    const [length = "", type = "", name = ""] = rest[0] === "list" ? rest.slice(1) : ["", ...rest];
    found.at(-1)?.properties.push({ name, type, length });
  }
  return found;
}

function element(properties: Property[], next: Next): Map<string, number[]> {
  return new Map(properties.map(({ name, type, length }) => {
    const count = length ? next(length) : 1;
    return [name, Array.from({ length: count }, () => next(type))];
  }));
}

function words(body: string): Next {
  const numbers = body.trim().split(/\s+/);
  let at = 0;
  return () => {
    if (at >= numbers.length) throw new Error("it ends too early");
    return Number(numbers[at++]);
  };
}

function values(bytes: ArrayBuffer, begin: number, isLittle: boolean): Next {
  const view = new DataView(bytes);
  let at = begin;
  return (type) => {
    const [read, size] = TYPES[type] ?? [];
    if (!read || !size) throw new Error(`it has values of an unknown type, ${type}`);
    const value = (view[read] as (at: number, isLittle: boolean) => number).call(view, at, isLittle);
    at += size;
    return value;
  };
}

/** Triangles of strips, which −1 parts; every second one turns the other way. */
function addStrips(index: number[], strips: number[]): void {
  let first = 0;
  strips.forEach((corner, at) => {
    if (corner < 0) first = at + 1;
    else if (at >= first + 2) {
      const [a, b] = [strips[at - 2]!, strips[at - 1]!];
      addFan(index, (at - first) % 2 ? [b, a, corner] : [a, b, corner]);
    }
  });
}
