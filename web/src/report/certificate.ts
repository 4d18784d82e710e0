/** What the report proves of this result, in words. */

import { counted, length, percent, type Unit } from "./format";
import { largestRatio, type Report } from "./report";

export interface Statement {
  holds: boolean;
  text: string;
  /** The longer story. */
  note: string;
}

/** Lengths in the scene's units. */
export interface Lengths {
  /** No point of the limit surface is farther from Loop's: what the report proves. */
  proved: number;
  /** What the budget would have allowed, with what creases keep back; null where it says nothing. */
  allowed: number | null;
  /** Largest distance of a vertex from its counterpart by Loop; null until that has come. */
  measured: number | null;
  /** By how much that may be wrong. */
  rounding: number;
  /** The model's own size: the diagonal of its box. */
  size: number;
  unit: Unit;
}

/** The statements of a refinement. */
export function certificate(report: Report, lengths: Lengths): Statement[] {
  if (!report.levels.length) {
    return [{ holds: false, text: "Nothing was refined", note: "The file has no triangle mesh." }];
  }
  const learned = report.scheme !== "loop";
  return [
    ...(learned ? nearness(report, lengths) : [loopAlone(lengths)]),
    folds(report),
    ...(learned ? [planes(report)] : []),
  ];
}

function loopAlone({ proved, unit }: Lengths): Statement {
  const note = proved
    ? `Creases alone keep it from Loop’s smooth rules, by at most ${length(proved, unit)}.`
    : "The distance to Loop is zero.";
  return { holds: true, text: "Loop’s rules alone", note: `Nothing learned took part. ${note}` };
}

function nearness(report: Report, lengths: Lengths): Statement[] {
  const { proved, allowed, measured, rounding, size, unit } = lengths;
  const used = Math.max(...report.levels.map(largestRatio));
  const bound = allowed === null ? "" : ` Its budget and creases allow ${length(allowed, unit)}.`;
  const most = proved * 1.001 + 1e-6 * size;
  // Else the two numbers would seem to disagree.
  const rounded = measured !== null && measured > most ? `, to ${length(rounding, unit)} by the file’s own rounding` : "";
  const apart = measured === null ? "" : ` Between the refined vertices: ${length(measured, unit)}${rounded}.`;
  return [
    {
      holds: measured === null || measured <= most + rounding,
      text: `Nowhere more than ${length(proved, unit)} from Loop`,
      note: `That is ${percent(proved / size)} of the model’s size, for every point of the limit surface.${bound}${apart}`,
    },
    {
      holds: used <= 1 + 1e-12,
      text: `Within its budget: at most ${percent(Math.min(used, 1))} of it used`,
      note: "Each vertex may leave Loop’s place (by the same creases) by C h² / R and no more, whatever the model says.",
    },
  ];
}

function folds(report: Report): Statement {
  const turned = report.levels.reduce((sum, level) => sum + level.flipped_faces, 0);
  const guarded = report.levels.reduce((sum, level) => sum + (level.guarded ?? 0), 0);
  const kept = guarded ? ` The guard shortened ${counted(guarded, "correction")} to keep it so.` : "";
  return turned
    ? {
        holds: false,
        text: `${counted(turned, "face")} turned over`,
        note: "A face points away from where Loop’s (by the same creases) would: look at the wireframe there.",
      }
    : {
        holds: true,
        // Loop itself may fold one, where what it refines is narrow.
        text: "No face turned over",
        note: `None points away from its counterpart by Loop (by the same creases), at any level.${kept}`,
      };
}

function planes(report: Report): Statement {
  const active = Math.max(...report.levels.map((level) => level.gate.active));
  return {
    holds: true,
    text: "Planes stay plane",
    note:
      "Where neighbouring faces are level the gate of each correction is shut: they are Loop’s, but for boundaries " +
      "and creases that bend within their plane. " +
      `It stood more than ${percent(0.01)} open on at most ${percent(active)} of the edges of a level.`,
  };
}
