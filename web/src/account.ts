/** Fill the panel: what a result's report and file say, and what is measured on it. */

import { isAbort } from "./api/problem";
import { dihedrals } from "./measure/dihedral";
import { distances, largestLength, rounding } from "./measure/distance";
import { surfaceOf } from "./measure/surface";
import type { Lengths } from "./report/promises";
import type { Result } from "./result";
import { NAMES } from "./settings";
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

let validation = new AbortController();
/** Facts of the file that is shown. */
let facts: { source: Source; before: Before } | null = null;

/** Show all that does not need the classic side. */
export function describe(ours: Result, source: Source, scale: Scale): void {
  const milliseconds = performance.now() - ours.began;
  certify(ours, null, scale);
  if (facts?.source !== source) facts = { source, before: before(source) };
  const sharpest = (): number => dihedrals(ours.model).max;
  showStatistics(facts.before, ours.report, ours.bytes.byteLength, sharpest);
  showChanges(ours.report);
  showAdvice(ours.report);
  showTimings([
    ...ours.timings.map(([name, ms]): [string, number] => [STAGES[name] ?? name, ms / 1000]),
    ["From request to picture", milliseconds / 1000],
  ]);
  void validateBoth(ours, source);
}

/** Show what is certain of the distance to the classic rule; returns it in a sentence. */
export function certify(ours: Result, loop: Result | null, scale: Scale): string {
  return showPromises(ours.report, lengths(ours, loop, scale));
}

function lengths({ model, report, classic }: Result, loop: Result | null, { size, unit }: Scale): Lengths {
  const ofMesh = new Map(report.meshes.map((mesh) => [mesh.index, mesh]));
  const measured = loop && distances(model, loop.model);
  return {
    proved: largestLength(model, (index) => ofMesh.get(index)?.limit_distance ?? 0) ?? 0,
    allowed: largestLength(model, (index) => ofMesh.get(index)?.limit_distance_bound),
    measured: measured && measured.max,
    rounding: rounding(model),
    size,
    unit,
    rule: NAMES[classic],
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
    sharpest: dihedrals(model).max,
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
