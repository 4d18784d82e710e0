/** Lines over the models, as the tools ask for them. */

import { edgesOf, normalsOf, type Lines } from "../view/lines";
import type { Look } from "../view/looks";
import type { Model } from "../view/model";
import { input } from "./dom";

/** Lines that may be drawn over both sides, by the id of their toggle. */
export const LINES = ["edges", "normal-lines"] as const;

/** Draw lines over models; `overlaid` is the control mesh that is shown by its edges alone. */
export function drawLines(
  models: Model[],
  overlaid: Model | null,
  lookOf: (model: Model) => Look,
  size: number,
): Lines[] {
  const style = getComputedStyle(document.body);
  const accent = style.getPropertyValue("--accent");
  const lines: Lines[] = [];
  for (const model of models) {
    if (model === overlaid) {
      // Clear in front, faint behind.
      lines.push(...edgesOf(model, accent, 0.9), ...edgesOf(model, accent, 0.2, true));
      continue;
    }
    // A wireframe without its lines would be nothing at all.
    const wire = lookOf(model) === "wire";
    if (input("edges").checked || wire) lines.push(...edgesOf(model, style.color, wire ? 0.9 : 0.35));
    if (input("normal-lines").checked) lines.push(...normalsOf(model, accent, size / 60));
  }
  return lines;
}
