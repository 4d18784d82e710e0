/** A refined file as the page holds it. */

import type { Answer } from "./api/jobs";
import { localProblem } from "./api/problem";
import { jsonOf, parseGltf, type GltfJson } from "./files/gltf";
import type { Upload } from "./files/upload";
import type { Report } from "./report/report";
import { isClassic, query, type Asked, type Classic } from "./settings";
import { modelOf, type Model } from "./view/model";

/** What is asked of the service. */
export interface Order {
  upload: Upload;
  asked: Asked;
  /** The classic rule for the file's faces; of a result for its own. */
  classic: Classic;
  /** By the page's clock. */
  began: number;
}

export interface Result extends Order {
  /** The query that made it. */
  key: string;
  bytes: ArrayBuffer;
  json: GltfJson;
  report: Report;
  model: Model;
  timings: [string, number][];
  /** Whether values at vertices are in it. */
  full: boolean;
}

export async function resultOf(order: Order, answer: Answer): Promise<Result> {
  const began = performance.now();
  const json = jsonOf(answer.bytes);
  const report = json.asset?.extras?.pns as Report | undefined;
  if (!report) throw new Error("The answer has no report.");
  const { scene, animations } = await parseGltf(answer.bytes);
  // A glTF goes in and comes out as triangles, even if it says how to join them.
  const isFlat = !["glb", "gltf", "zip"].includes(order.upload.kind);
  const polygons = isFlat && (json.extensionsUsed ?? []).includes("FB_ngon_encoding");
  const model = modelOf(scene, animations);
  for (const { userData } of model.meshes) userData.polygons = polygons;
  const timings: [string, number][] = [...answer.timings, ["opening", performance.now() - began]];
  return {
    ...order,
    classic: isClassic(report.base) ? report.base : order.classic,
    key: query(order.asked.settings, order.classic).toString(),
    bytes: answer.bytes,
    json,
    report,
    model,
    timings,
    full: false,
  };
}

/** Make something of an answer. A failure is no fault of the user's file, and another try may do. */
export async function shownIn<T>(what: string, make: () => Promise<T>): Promise<T> {
  try {
    return await make();
  } catch (error) {
    throw localProblem(`${what} cannot be shown`, (error as Error).message);
  }
}
