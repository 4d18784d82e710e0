/** OFF, as text or binary: counts, vertices, polygons; what follows a polygon's corners is its colour. */

import { BufferAttribute, BufferGeometry } from "three";
import { addFan } from "./polygons";
import { textOf } from "./text";

/** The counts may stand behind it at once, or without it. */
const HEADER = /^\s*(?:#[^\n]*\n\s*)*(?:((?:ST|[CN4])*)OFF(?:[ \t]+(BINARY)[^\n]*\n)?|(?=\d))/i;
/** Numbers that a letter of the header adds to a vertex. */
const WIDTHS: Record<string, number> = { ST: 2, C: 4, N: 3, 4: 1 };

export function readOff(bytes: ArrayBuffer): BufferGeometry {
  const [header, kinds, isBinary] = HEADER.exec(new TextDecoder("latin1").decode(bytes.slice(0, 1000))) ?? [];
  if (isBinary) return readBinary(new DataView(bytes, header!.length), kinds ?? "");
  const lines = textOf(bytes)
    .replace(HEADER, "\n")
    .replace(/#.*/g, "")
    .split("\n")
    .map((line) => line.trim().split(/\s+/).map(Number))
    .filter((numbers) => numbers.length > 1 || numbers[0]);
  const [vertices = 0, faces = 0] = lines[0] ?? [];
  const points = lines.slice(1, 1 + vertices).flatMap((line) => line.slice(0, 3));
  const index: number[] = [];
  for (const [corners = 0, ...polygon] of lines.slice(1 + vertices, 1 + vertices + faces)) {
    addFan(index, polygon.slice(0, corners));
  }
  return checked(points, index, vertices);
}

/** Words of four bytes, the highest first; some programs write the lowest first. */
function readBinary(view: DataView, kinds: string): BufferGeometry {
  const width = (kinds.toUpperCase().match(/ST|[CN4]/g) ?? []).reduce((sum, kind) => sum + WIDTHS[kind]!, 3);
  const words = Math.floor(view.byteLength / 4);
  const isLittle = 3 + width * view.getInt32(0) > words || view.getInt32(0) < 0;
  const whole = (word: number): number => view.getInt32(4 * word, isLittle);
  const [vertices, faces] = [whole(0), whole(1)];
  const points = Array.from({ length: 3 * vertices }, (_, i) =>
    view.getFloat32(4 * (3 + width * Math.floor(i / 3) + (i % 3)), isLittle),
  );
  const index: number[] = [];
  let at = 3 + width * vertices;
  for (let face = 0; face < faces; face++) {
    const corners = whole(at);
    addFan(index, Array.from({ length: corners }, (_, i) => whole(at + 1 + i)));
    at += 2 + corners + whole(at + 1 + corners);
  }
  return checked(points, index, vertices);
}

function checked(points: number[], index: number[], vertices: number): BufferGeometry {
  if (points.length < 3 * vertices || !index.length || index.some((at) => !(at < vertices))) {
    throw new Error("its counts and its lines disagree");
  }
  return new BufferGeometry()
    .setAttribute("position", new BufferAttribute(new Float32Array(points), 3))
    .setIndex(index);
}
