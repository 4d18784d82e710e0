/** Fill the panel: what a result's report and file say, and what is measured on it. */

import { isAbort } from "./api/problem";
import { closeness, type Closeness } from "./measure/closeness";
import { distances, largestLength, rounding } from "./measure/distance";
import { surfaceOf } from "./measure/surface";
import type { Lengths } from "./report/promises";
import type { Result } from "./result";
import { nameOf, type Settings } from "./settings";
import type { Source } from "./tasks";
import {
  showAdvice,
  showChanges,
  showPromises,
  showStatistics,
  showTimings,
  showValidation,
  type Before,
} from "./ui/results";
import type { Model } from "./view/model";
import { compare } from "./validate/compare";
import { validate } from "./validate/validate";

/** The model's size, and the unit of its lengths. */
type Scale = Pick<Lengths, "size" | "unit">;

const STAGES: Record<string, string> = {
  read: "Service: reading",
  weld: "Service: welding",
  refine: "Service: refining",
  attributes: "Service: attributes",
  write: "Service: writing",
  upload: "Upload",
  queue: "Queue",
  total: "Service: in all",
  opening: "Opening the result",
};

/** How far results are from their files. */
const apart = new WeakMap<Model, Closeness | null>();
/** What is certified on the page. */
let certified: Parameters<typeof certify> | null = null;
let [validation, measurement] = [new AbortController(), new AbortController()];
/** Facts of the file that is shown. */
let facts: { source: Source; before: Before } | null = null;

/** Show all that does not need the classic side. */
export function describe(
  ours: Result, source: Source, scale: Scale, set: (settings: Partial<Settings>) => void,
): void {
  const milliseconds = performance.now() - ours.began;
  certify(ours, source, null, scale);
  if (facts?.source !== source) facts = { source, before: before(source) };
  showStatistics(facts.before, ours.report, ours.bytes.byteLength);
  showChanges(ours.report);
  showAdvice(ours.report, set);
  showTimings([
    ...ours.timings.map(([name, ms]): [string, number] => [STAGES[name] ?? name, ms / 1000]),
    ["From request to picture", milliseconds / 1000],
  ]);
  void validateBoth(ours, source);
  void measure(ours, source);
}

/** Show what is certain of a result; returns it in a sentence. */
export function certify(ours: Result, source: Source, loop: Result | null, scale: Scale): string {
  certified = [ours, source, loop, scale];
  return showPromises(ours.report, lengths(ours, loop, scale));
}

/** Measure how far a result is from its file, and show it. */
async function measure({ model }: Result, { model: file }: Source): Promise<void> {
  measurement.abort();
  const { signal } = (measurement = new AbortController());
  try {
    if (!apart.has(model)) apart.set(model, await closeness(file, model, signal));
    if (certified?.[0].model === model) certify(...certified);
  } catch (error) {
    if (!isAbort(error)) throw error;
  }
}

function lengths(ours: Result, loop: Result | null, { size, unit }: Scale): Lengths {
  const { model, report } = ours;
  const ofMesh = new Map(report.meshes.map((mesh) => [mesh.index, mesh]));
  const measured = loop && distances(ours, loop);
  return {
    proved: largestLength(model, (index) => ofMesh.get(index)?.limit_distance ?? 0),
    apart: apart.get(model),
    within: report.meshes.some(({ adaptive }) => adaptive)
      ? largestLength(model, (index) => ofMesh.get(index)?.adaptive?.distance_max ?? 0)
      : null,
    measured: measured && measured.max,
    rounding: rounding(model),
    size,
    unit,
    rule: nameOf(report.base),
  };
}

/** Measure the file itself. */
function before({ upload, opened, model }: Source): Before {
  const geometries = new Set(model.meshes.map(({ geometry }) => geometry));
  const vertices = [...geometries].reduce((n, g) => n + g.getAttribute("position").count, 0);
  return {
    faces: opened.faces,
    vertices,
    bytes: upload.bytes,
    surface: surfaceOf(model.meshes),
  };
}

async function validateBoth(ours: Result, { opened: { gltf } }: Source): Promise<void> {
  validation.abort();
  const { signal } = (validation = new AbortController());
  showValidation("Looking at both files…");
  try {
    const result = await validate({ bytes: ours.bytes, neighbours: new Map() }, signal);
    const first = gltf ? await validate(gltf, signal) : null;
    showValidation(compare(first, result));
  } catch (error) {
    if (!isAbort(error)) showValidation(`The validator could not run: ${(error as Error).message}`);
  }
}
