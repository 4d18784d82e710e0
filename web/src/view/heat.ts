/** The numbers that colour a result, and the legend that explains them. */

import { BufferAttribute } from "three";
import type { Result } from "../result";
import { dihedrals } from "../measure/dihedral";
import { distances, type Field } from "../measure/distance";
import { angle, figure, length, percent, type Unit } from "../report/format";
import { isLearned, learnedLevels } from "../report/report";
import { isClassic } from "../settings";
import { heatRange } from "./looks";
import type { Model } from "./model";

const UNLEARNED = "Nothing learned took part in this result.";

export type Heat = "distance" | "ratio" | "gate" | "dihedral";

export const HEATS: readonly Heat[] = ["distance", "ratio", "gate", "dihedral"];

/** Whether the values come with the file, on demand. */
export function needsFull(heat: Heat): boolean {
  return heat === "ratio" || heat === "gate";
}

/** This share of the vertices keeps its own colours; values above share the last one. */
const CLIP = 0.98;

export interface Legend {
  title: string;
  low: string;
  high: string;
  /** The upper end of the colours. */
  end: number;
  /** The largest value. */
  max: number;
  note: string;
}

/** The size of the model, and the unit of its lengths. */
export interface Scale {
  size: number;
  unit: Unit;
}

/** Colour the result; null where the values are not there. */
export function colour(heat: Heat, ours: Result, loop: Result | null, scale: Scale): Legend | null {
  const shown = field(heat, ours, loop);
  if (!shown) return null;
  shown.values.forEach((values, number) =>
    ours.model.meshes[number]!.geometry.setAttribute("heat", new BufferAttribute(values, 1)),
  );
  const end = clipped(shown);
  heatRange.high.value = end;
  const { title, write, note } = describe(heat, ours, scale);
  const isClipped = end < shown.max;
  return {
    title,
    low: write(0),
    high: `${isClipped ? "≥ " : ""}${write(end)}`,
    end,
    max: shown.max,
    note: isClipped ? `${note} The largest is ${write(shown.max)}.` : note,
  };
}

/** Return the end of the colours: few sharp corners would leave one colour for all the rest. */
function clipped({ values, max }: Field): number {
  const all = new Float32Array(values.reduce((sum, { length }) => sum + length, 0));
  let at = 0;
  for (const part of values) {
    all.set(part, at);
    at += part.length;
  }
  const end = all.sort()[Math.ceil(CLIP * all.length) - 1] ?? 0;
  // Where nearly all vertices have no value, the few that have one show it.
  return end > 0 ? end : max;
}

function field(heat: Heat, ours: Result, loop: Result | null): Field | null {
  if (isZero(heat, ours)) return zeros(ours.model);
  switch (heat) {
    case "distance":
      return loop && distances(ours, loop);
    case "dihedral":
      return dihedrals(ours.model);
    default:
      return attribute(ours.model, `_pns_${heat}`);
  }
}

/** Whether there is nothing to show: nothing is learned in a formula's own result. */
function isZero(heat: Heat, { report }: Result): boolean {
  if (isLearned(report) || heat === "dihedral") return false;
  return heat !== "distance" || isClassic(report.base);
}

function zeros(model: Model): Field {
  const values = model.meshes.map(({ geometry }) => new Float32Array(geometry.getAttribute("position").count));
  return { values, max: 0 };
}

function attribute(model: Model, name: string): Field | null {
  const values: Float32Array[] = [];
  let max = 0;
  for (const { geometry } of model.meshes) {
    if (!geometry.hasAttribute(name)) return null;
    const at = geometry.getAttribute(name);
    values.push(Float32Array.from({ length: at.count }, (_, i) => at.getX(i)));
    max = values.at(-1)!.reduce((a, b) => Math.max(a, b), max);
  }
  return { values, max };
}

interface Description {
  title: string;
  write: (value: number) => string;
  note: string;
}

function describe(heat: Heat, ours: Result, { size, unit }: Scale): Description {
  const { report } = ours;
  const last = learnedLevels(report) || report.levels.length;
  const carried = last < report.levels.length ? " Later vertices have the mean of their edge’s ends." : "";
  const described = DESCRIPTIONS[heat](last, carried, { size, unit });
  return isZero(heat, ours) ? { ...described, note: UNLEARNED } : described;
}

const DESCRIPTIONS: Record<Heat, (level: number, carried: string, scale: Scale) => Description> = {
  distance: (_level, _carried, { size, unit }) => ({
    title: "Distance to classic",
    write: (value) => `${percent(value / size)} (${length(value, unit)})`,
    note: "From the classic surface, in per cent of the model’s size.",
  }),
  ratio: (level, carried) => ({
    title: "Share of the bound used",
    write: (value) => percent(Math.min(value, 1)),
    note: `Of corrections at level ${level}; ${percent(1)} is the bound C h² / R.${carried}`,
  }),
  gate: (level, carried) => ({
    title: "Gate of the rule",
    write: (value) => figure(value),
    note: `The gate γ: 0 on planes, 1 at sharp edges; of level ${level}.${carried}`,
  }),
  dihedral: () => ({
    title: "Angles of faces",
    write: angle,
    note: "The largest turn between faces at each vertex.",
  }),
};
