/** Which numbers colour the result, their unit, and the ends of the scale. */

import { BufferAttribute } from "three";
import type { Result } from "../session";
import { dihedrals } from "../measure/dihedral";
import { distances, type Field } from "../measure/distance";
import { angle, figure, length, percent, type Unit } from "../report/format";
import { largestGate, largestRatio, learnedLevels } from "../report/report";
import { LOOP } from "../settings";
import { heatRange } from "./looks";
import type { Model } from "./model";

const BY_LOOP = "This result is Loop’s: nothing learned took part.";

export type Heat = "distance" | "ratio" | "gate" | "dihedral";

export const HEATS: readonly Heat[] = ["distance", "ratio", "gate", "dihedral"];

/** Whether the values come with the file, on demand. */
export function needsFull(heat: Heat): boolean {
  return heat === "ratio" || heat === "gate";
}

export interface Legend {
  title: string;
  low: string;
  high: string;
  /** The upper end as a number. */
  end: number;
  note: string;
}

/** Colour the result; null where the values are not there. */
export function colour(
  heat: Heat,
  ours: Result,
  loop: Result | null,
  unit: Unit,
): Legend | null {
  const shown = field(heat, ours, loop);
  if (!shown) return null;
  shown.values.forEach((values, number) =>
    ours.model.meshes[number]!.geometry.setAttribute("heat", new BufferAttribute(values, 1)),
  );
  const legend = legendOf(heat, shown.max, ours, unit);
  heatRange.high.value = legend.end;
  return legend;
}

function field(heat: Heat, ours: Result, loop: Result | null): Field | null {
  if (ours.report.scheme === LOOP && heat !== "dihedral") return zeros(ours.model);
  switch (heat) {
    case "distance":
      return loop && distances(ours.model, loop.model);
    case "dihedral":
      return dihedrals(ours.model);
    default:
      return attribute(ours.model, `_pns_${heat}`);
  }
}

/** What Loop's rules alone leave of all that is learned. */
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

function legendOf(heat: Heat, max: number, { report }: Result, unit: Unit): Legend {
  const isLoop = report.scheme === LOOP;
  // Where no level is learned the last one has nothing to show, and says so.
  const last = learnedLevels(report) || report.levels.length;
  const level = report.levels[last - 1];
  const carried = last < report.levels.length ? " Later vertices have the mean of their edge’s ends." : "";
  switch (heat) {
    case "distance":
      return {
        title: "Distance to Loop",
        low: length(0, unit),
        high: length(max, unit),
        end: max,
        note: isLoop ? BY_LOOP : "Each vertex against its counterpart by Loop’s rules.",
      };
    case "ratio": {
      const end = level && !isLoop ? largestRatio(level) : max;
      return {
        title: "Share of the budget",
        low: percent(0),
        high: percent(Math.min(end, 1)),
        end,
        note: isLoop ? BY_LOOP : `Of corrections at level ${last}; ${percent(1)} is the bound C h² / R.${carried}`,
      };
    }
    case "gate": {
      const end = level && !isLoop ? largestGate(level) : max;
      return {
        title: "Gate",
        low: "0, shut",
        high: `${figure(end)}${end > 0.995 ? ", open" : ""}`,
        end,
        note: isLoop ? BY_LOOP : `Shut on planes, open at sharp edges; of level ${last}.${carried}`,
      };
    }
    case "dihedral":
      return {
        title: "Dihedral angle",
        low: "0°",
        high: angle(max),
        end: max,
        note: "The largest turn between faces at each vertex.",
      };
  }
}
