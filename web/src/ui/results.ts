/** The account of a result: promises, advice, statistics, changes, validator, timings. */

import type { Comparison } from "../validate/compare";
import { bytes, count, figure, listed, seconds } from "../report/format";
import type { Surface } from "../measure/surface";
import { promises, type Lengths } from "../report/promises";
import { sharpEdges, type Advice, type Report } from "../report/report";
import type { Settings } from "../settings";
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

/** Options of the service that the page names itself, and the settings that their values stand for. */
const DEEDS: Record<string, (value: string) => [string, Partial<Settings>]> = {
  crease: (value) =>
    value === "off"
      ? ["Round throughout", { crease: "off" }]
      : ["Crisp edges", { crease: "angle", angle: Number(value.replace("angle:", "")) }],
  normals: () => ["Smooth shading", { normals: "smooth" }],
  weld_tolerance: () => ["Close small gaps", { weld: true }],
};

/** The page's names for options of an advice, and their settings. */
function deeds({ options }: Advice): { option: string; label: string; settings: Partial<Settings> }[] {
  return options.flatMap((option) => {
    const [name = "", value = ""] = option.split("=");
    const [label, settings] = DEEDS[name]?.(value) ?? [];
    return label && settings ? [{ option, label, settings }] : [];
  });
}

/** Show the first thing that the user should know or do, and buttons that do it. */
export function showAdvice(report: Report, set: (settings: Partial<Settings>) => void): void {
  const asked = changesOf(report).flatMap(({ text, advice }) =>
    advice && deeds(advice).length ? [{ text, options: advice.options }] : [],
  );
  const [first] = [...(report.advice ?? []), ...asked];
  element("advice").hidden = !first;
  element("advice-text").textContent = first ? inOurWords(first.text, first) : "";
  element("advice-deeds").replaceChildren(
    ...(first ? deeds(first) : []).map(({ label, settings }) =>
      make("button", { textContent: label, onclick: () => set(settings) }),
    ),
  );
}

export interface Before {
  faces: number;
  vertices: number;
  bytes: number;
  surface: Surface;
}

export function showStatistics(before: Before, report: Report, size: number): void {
  const last = report.levels.at(-1);
  const { surface } = before;
  const rows: [string, string, string][] = [
    ["Faces", count(before.faces), count(report.totals.faces)],
    ["Vertices in the file", count(before.vertices), count(report.totals.vertices)],
    ["File", bytes(before.bytes), bytes(size)],
  ];
  // The levels of faces made where they are needed are no whole meshes.
  if (last && !report.meshes.some(({ adaptive }) => adaptive)) {
    const sharp = sharpEdges(last);
    rows.push(
      ["Vertices of the surface", count(surface.vertices), count(last.vertices)],
      ["Boundary edges", count(surface.boundary), count(last.edges.boundary)],
      ["Irregular edges", count(surface.irregular), count(last.edges.irregular)],
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

interface ListedChange {
  /** What was changed, how often, and what to do. */
  text: string;
  advice: Advice | undefined;
  where: string;
}

/** Everything that was changed or lost, each thing once. */
function changesOf(report: Report): ListedChange[] {
  const changes = new Map<string, Report["changes"]>();
  for (const change of report.changes) changes.set(change.what, [...(changes.get(change.what) ?? []), change]);
  for (const [name, count] of Object.entries(report.dropped)) {
    const code = name === "vertices" ? "unused-vertices" : name.replaceAll("_", "-");
    const what = `${name.replaceAll("_", " ")} dropped`;
    if (count && !report.changes.some((change) => change.code === code)) {
      changes.set(what, [{ pointer: "", code, what, count }]);
    }
  }
  return [...changes].map(([what, all]) => {
    const times = all.reduce((sum, { count }) => sum + count, 0);
    const advice = report.hints?.[all[0]?.code ?? ""];
    const places = all.map(({ pointer }) => [nameAt(report, pointer), pointer].filter(Boolean).join(", "));
    return {
      text: `${times > 1 ? `${count(times)} × ` : ""}${what}${advice ? `: ${advice.text}` : ""}`,
      advice,
      where: listed(places.filter(Boolean), 1),
    };
  });
}

export function showChanges(report: Report): void {
  const all = changesOf(report);
  element("changes-count").textContent = all.length ? String(all.length) : "none";
  element("changes").replaceChildren(
    ...(all.length
      ? all.map(({ text, advice, where }) =>
          make("li", {}, inOurWords(text, advice), ...(where ? [make("span", { className: "where", textContent: where })] : [])),
        )
      : [make("li", { className: "note", textContent: "Nothing beside the geometry changed." })]),
  );
}

/** Name settings as the page does. */
function inOurWords(text: string, advice?: Advice): string {
  return (advice ? deeds(advice) : []).reduce((said, { option, label }) => said.replace(option, `“${label}”`), text);
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
