/** How close a result stays, in plain words, and the mathematics behind them. */

import type { Closeness } from "../measure/closeness";
import { counted, length, percent, type Unit } from "./format";
import { isLearned, largestRatio, sharpEdges, type Report } from "./report";

export interface Promised {
  holds: boolean;
  title: string;
  text: string;
  /** The statement as a mathematician would make it. */
  mathematics: string;
}

/** Lengths in the scene's units. */
export interface Lengths {
  /** The largest distance of the limit surface from the classic rule's, as the report proves it. */
  proved: number;
  /** How far the result and the user's own model are apart; null where it cannot be told; undefined until it is known. */
  apart: Closeness | null | undefined;
  /** How far faces made where they are needed are from the smooth surface at most, as the report proves it; null for others. */
  within: number | null;
  /** The largest distance between a vertex and its counterpart by the classic rule; null until that side is there. */
  measured: number | null;
  /** The possible error of `measured`. */
  rounding: number;
  /** The diagonal of the model's box. */
  size: number;
  unit: Unit;
  /** The classic rule's name. */
  rule: string;
}

export function promises(report: Report, lengths: Lengths): Promised[] {
  if (!report.levels.length && lengths.within === null) {
    const text = "The file has no triangle mesh.";
    return [{ holds: false, title: "Nothing was refined", text, mathematics: "" }];
  }
  const learned = isLearned(report);
  return [
    ...(learned
      ? [closeness(report, lengths), folding(report, lengths), flatness(report, lengths)]
      : [classic(lengths)]),
    ...flatEnough(lengths),
  ];
}

function distanceOf({ apart, size }: Lengths): string {
  if (apart === undefined) return "Measuring how far it is from your model…";
  if (!apart) return "How close is proved: see Research.";
  const { most, mean } = apart;
  return `At most ${percent(most / size)} of the model’s size away from your file, ${percent(mean / size)} on average: measured from each surface to the other.`;
}

function classic(lengths: Lengths): Promised {
  const { proved, unit, rule } = lengths;
  const kept = proved ? ` Sharp edges keep it within ${length(proved, unit)} of the surface without them.` : "";
  return {
    holds: true,
    title: "Nothing learned",
    text: `This is ${rule}’s rule alone. ${distanceOf(lengths)}`,
    mathematics: `Distance to ${rule}’s limit surface with the same creases: ${length(0, unit)}.${kept}`,
  };
}

function closeness(report: Report, lengths: Lengths): Promised {
  const { proved, measured, rounding, size, unit, rule } = lengths;
  const used = Math.max(...report.levels.map(largestRatio));
  const most = proved * 1.001 + 1e-6 * size;
  // Without this remark the two numbers would seem to disagree.
  const rounded = measured !== null && measured > most ? `, to ${length(rounding, unit)} by the file’s own rounding` : "";
  const between = measured === null ? "" : ` Measured between the refined vertices: ${length(measured, unit)}${rounded}.`;
  const sharp = report.levels.some(sharpEdges) ? ", which rounds sharp edges too" : "";
  return {
    holds: (measured === null || measured <= most + rounding) && used <= 1 + 1e-12,
    title: "Stays close",
    text: distanceOf(lengths),
    mathematics:
      `Every point of the limit surface is within ${length(proved, unit)} of ${rule}’s${sharp}.${between} ` +
      `Each vertex may leave its place by ${rule}’s rule by C h² / R at most, whatever the model says; ` +
      `at most ${percent(Math.min(used, 1))} of that was used.`,
  };
}

function flatEnough({ within, size, unit }: Lengths): Promised[] {
  if (within === null) return [];
  return [
    {
      holds: true,
      title: "Faces where it bends",
      text: `No point of the smooth surface is farther from the face under it than ${percent(within / size)} of the model’s size.`,
      mathematics: `No point of the limit surface over a face is farther than ${length(within, unit)} from the face’s plane.`,
    },
  ];
}

function folding(report: Report, { rule }: Lengths): Promised {
  const turned = report.levels.reduce((sum, level) => sum + level.flipped_faces, 0);
  const guarded = report.levels.reduce((sum, level) => sum + (level.guarded ?? 0), 0);
  const kept = guarded ? ` The guard shortened ${counted(guarded, "correction")} to keep it so.` : "";
  return {
    holds: turned === 0,
    title: "Adds no folds",
    text: turned
      ? `${counted(turned, "face")} turned over: look at the wireframe there.`
      : "What PNS adds turns no face over.",
    mathematics:
      `${turned ? counted(turned, "face") : "No face"} at any level points away from its counterpart by ${rule}’s rule ` +
      `with the same creases.${kept}`,
  };
}

function flatness(report: Report, { rule }: Lengths): Promised {
  const active = Math.max(...report.levels.map((level) => level.gate.active));
  return {
    holds: true,
    title: "Keeps planes",
    text: "Where a face and its neighbours lie in one plane, so does the result.",
    mathematics:
      `By construction: where neighbouring faces are coplanar the gate γ of each correction is 0, and the vertices are ${rule}’s; ` +
      "boundaries and creases may bend within their plane. " +
      `γ exceeded 0.01 on at most ${percent(active)} of the edges of a level.`,
  };
}
