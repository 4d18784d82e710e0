/** The account of a result: promises, advice, statistics, changes, validator, timings. */

import type { Comparison } from "../validate/compare";
import { angle, bytes, count, figure, seconds } from "../report/format";
import type { Surface } from "../measure/surface";
import { promises, type Lengths } from "../report/promises";
import { sharpEdges, type Report } from "../report/report";
import { element, make } from "./dom";

/** Show the promises; returns them in one sentence. */
export function showPromises(report: Report, lengths: Lengths): string {
  const promised = promises(report, lengths);
  element("promises").replaceChildren(
    ...promised.map(({ holds, title, text }) =>
      make(
        "li",
        { className: holds ? "" : "broken" },
        make(
          "div",
          {},
          make("span", { className: "hidden", textContent: holds ? "Kept: " : "Broken: " }),
          make("strong", { textContent: title }),
          ` ${text}`,
        ),
      ),
    ),
  );
  element("mathematics").replaceChildren(
    ...promised.filter(({ mathematics }) => mathematics).map(({ title, mathematics }) =>
      make("li", {}, make("strong", { textContent: `${title}. ` }), mathematics),
    ),
  );
  const made = element("made-by");
  made.textContent = report.model
    ? `Model ${report.model}, C = ${figure(report.budget ?? 0)}, hash ${report.model_hash?.slice(0, 12)}…`
    : "";
  made.title = report.model_hash ?? "";
  return promised.map(({ title, text }) => `${title}: ${text}`).join(" ");
}

/** The settings that advice may name: the service's options, and the page's words. */
const WORDS: [RegExp, string][] = [
  [/\buse crease=angle:(\d+)/, "choose Sharp edges: By angle, above $1°"],
  [/\b(use )?crease=off/, "choose Sharp edges: None"],
  [/\buse normals=smooth/, "choose Shading: Smooth"],
  [/\buse weld_tolerance=[\d.]+/, "switch on Close small gaps"],
];

/** Say it in the page's own words for the settings. */
function inOurWords(text: string): string {
  return WORDS.reduce((said, [option, word]) => said.replace(option, word), text);
}

/** Show why little changed. */
export function showAdvice({ advice = [] }: Report): void {
  element("advice").hidden = !advice.length;
  element("advice").replaceChildren(
    ...advice.map((text) => make("li", { textContent: inOurWords(text) })),
  );
}

export interface Before {
  faces: number;
  vertices: number;
  bytes: number;
  surface: Surface;
  /** Degrees. */
  sharpest: number;
}

/** Show the table. `sharpest` is called where creases are left out of the report's largest turn. */
export function showStatistics(
  before: Before, report: Report, size: number, sharpest: () => number,
): void {
  const last = report.levels.at(-1);
  const { surface } = before;
  const rows: [string, string, string][] = [
    ["Faces", count(before.faces), count(report.totals.faces)],
    ["Vertices in the file", count(before.vertices), count(report.totals.vertices)],
    ["File", bytes(before.bytes), bytes(size)],
  ];
  if (last) {
    const sharp = sharpEdges(last);
    const after = sharp ? sharpest() : (last.normal_jump_max * 180) / Math.PI;
    rows.push(
      ["Vertices of the surface", count(surface.vertices), count(last.vertices)],
      ["Boundary edges", count(surface.boundary), count(last.edges.boundary)],
      ["Irregular edges", count(surface.irregular), count(last.edges.irregular)],
      ["Sharpest edge", angle(before.sharpest), angle(after)],
      ["Faces turned over", "–", count(report.levels.reduce((n, l) => n + l.flipped_faces, 0))],
    );
    if (sharp) rows.push(["Sharp edges", "–", count(sharp)]);
  }
  fill("statistics", rows);
}

export function showTimings(rows: [string, number][]): void {
  fill(
    "timings",
    rows.map(([name, time]) => [name, seconds(time)]),
  );
}

export function showChanges(report: Report): void {
  const said = new Set(report.changes.map(({ what }) => what));
  const dropped = Object.entries(report.dropped)
    .map(([name, n]) => ({ pointer: "", what: `${name.replaceAll("_", " ")} dropped`, count: n }))
    .filter(({ what, count }) => count > 0 && !said.has(what));
  const all = [...report.changes, ...dropped];
  element("changes-count").textContent = all.length ? String(all.length) : "none";
  element("changes").replaceChildren(
    ...(all.length
      ? all.map(({ pointer, what, count: n }) => {
          const hint = report.hints?.[what];
          const place = [nameAt(report, pointer), pointer].filter(Boolean).join(", ");
          return make(
            "li",
            {},
            `${n > 1 ? `${count(n)} × ` : ""}${what}${hint ? `: ${inOurWords(hint)}` : ""}`,
            ...(place ? [make("span", { className: "where", textContent: place })] : []),
          );
        })
      : [make("li", { className: "note", textContent: "Nothing beside the geometry changed." })]),
  );
}

/** The name of the mesh that a pointer leads to; "" without one. */
function nameAt({ meshes }: Report, pointer: string): string {
  const index = Number(/^\/meshes\/(\d+)/.exec(pointer)?.[1]);
  return meshes.find((mesh) => mesh.index === index)?.name ?? "";
}

export function showValidation(comparison: Comparison | string): void {
  const badge = element("validation-badge");
  const text = element("validation-text");
  const list = element("findings");
  list.replaceChildren();
  if (typeof comparison === "string") {
    badge.textContent = "";
    text.textContent = comparison;
    return;
  }
  const fresh = comparison.findings.filter((finding) => finding.isNew && finding.severity < 2);
  badge.className = `badge ${fresh.length ? "bad" : "good"}`;
  badge.textContent = fresh.length ? `${fresh.length} new` : "nothing new";
  text.textContent = `Khronos’ glTF Validator. Result: ${comparison.after}. Input: ${comparison.before}.`;
  list.replaceChildren(
    ...comparison.findings.map(({ code, message, pointer, times, isNew, severity }) =>
      make(
        "li",
        { className: isNew && severity < 2 ? "new" : "" },
        `${isNew ? "New: " : ""}${times > 1 ? `${times} × ` : ""}${message || code}`,
        make("span", { className: "where", textContent: `${code} ${pointer}` }),
      ),
    ),
  );
}

function fill(id: string, rows: string[][]): void {
  const body = element<HTMLTableElement>(id).tBodies[0]!;
  body.replaceChildren(
    ...rows.map(([name, ...cells]) =>
      make(
        "tr",
        {},
        make("th", { scope: "row", textContent: name ?? "" }),
        ...cells.map((text) => make("td", { textContent: text })),
      ),
    ),
  );
}
