/** Labels over the two sides: which mesh, and how many faces. */

import { counted } from "../report/format";
import type { Result } from "../result";
import { isClassic, nameOf } from "../settings";
import type { Source } from "../tasks";
import type { Layout } from "../view/viewer";
import { element, make } from "./dom";

interface Label {
  title: string;
  /** What there is room for on a wide screen alone, and what is always shown. */
  more?: string;
  text: string;
}

/** Show the labels; `loop` is given where it takes the left side. */
export function showLabels(source: Source | null, ours: Result | null, loop: Result | null, layout: Layout): void {
  const [left, right] = labels(source, ours, loop, layout);
  for (const [side, label] of [["left", left], ["right", right]] as const) {
    element(`label-${side}`).hidden = !label;
    element(`label-${side}`).replaceChildren(
      make("strong", { textContent: label?.title ?? "" }),
      make("span", { className: "wide-only", textContent: label?.more ?? "" }),
      make("span", { textContent: label?.text ?? "" }),
    );
  }
}

function labels(
  source: Source | null,
  ours: Result | null,
  loop: Result | null,
  layout: Layout,
): [Label | null, Label | null] {
  const of = ({ report }: Result): string => counted(report.totals.faces, "face");
  const rule = ({ report }: Result): string => (isClassic(report.base) ? "Classic" : nameOf(report.base));
  const refined = ours && {
    title: "After",
    more: `${!ours.report.model ? rule(ours) : ours.asked.settings.faces === null ? `Smoothness ${ours.report.levels.length}` : "Only where it bends"} · `,
    text: of(ours),
  };
  const before = source && { title: "Before", text: counted(source.opened.faces, "face") };
  if (layout === "overlay" || layout === "single") return [null, refined ?? before];
  if (loop && ours) return [{ title: `Classic (${nameOf(loop.classic)})`, text: of(loop) }, refined];
  return [before, refined];
}
