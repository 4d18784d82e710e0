/** One refinement: upload, queue, stages, download. A signal cancels each of them. */

import { address, headers, pieces, request } from "./client";
import { events } from "./events";
import { gzipped } from "./gzip";
import { localProblem, Problem, problemOf, type ProblemDocument } from "./problem";

export interface Body {
  content: Blob | FormData;
  /** Empty for a form, which brings its own. */
  type: string;
}

export type Step = "open" | "upload" | "queue" | "refine" | "download";

export interface Progress {
  step: Step;
  /** 0 to 1; null while it cannot be known. */
  share: number | null;
  /** Before this job in the queue; only while queued. */
  place?: number | null;
  stage?: string | null;
  /** Seconds that the service expects the job to take in all. */
  estimate?: number | null;
}

export interface Answer {
  bytes: ArrayBuffer;
  /** Milliseconds by stage, from Server-Timing. */
  timings: [string, number][];
}

interface Job {
  id: string;
  state: "queued" | "running" | "done" | "failed" | "cancelled";
  queue_place: number | null;
  stage: string | null;
  share: number | null;
  estimate_seconds?: number | null;
  problem?: ProblemDocument | null;
}

export async function refine(
  body: Body,
  query: URLSearchParams,
  signal: AbortSignal,
  tell: (progress: Progress) => void,
): Promise<Answer> {
  const location = await upload(`jobs?${query}`, body, signal, tell);
  try {
    await finished(location, signal, tell);
    return await download(location, signal, tell);
  } finally {
    // Free the worker at once where the job was cancelled, and the result's memory otherwise.
    void request(location, { method: "DELETE", keepalive: true }).catch(() => {});
  }
}

/** Send the body. By XMLHttpRequest: fetch does not report how much of a body has gone out. */
async function upload(
  path: string,
  body: Body,
  signal: AbortSignal,
  tell: (progress: Progress) => void,
): Promise<string> {
  tell({ step: "upload", share: 0 });
  const packed = await gzipped(body);
  return new Promise((resolve, reject) => {
    const sent = new XMLHttpRequest();
    sent.open("POST", address(path));
    for (const [name, value] of Object.entries(headers())) sent.setRequestHeader(name, value);
    if (body.type) sent.setRequestHeader("Content-Type", body.type);
    if (packed) sent.setRequestHeader("Content-Encoding", "gzip");
    sent.upload.onprogress = (event) =>
      tell({ step: "upload", share: event.lengthComputable ? event.loaded / event.total : null });
    sent.onload = () => {
      if (sent.status !== 202) return reject(problemOf(sent.status, sent.responseText));
      try {
        resolve(`jobs/${(JSON.parse(sent.responseText) as Job).id}`);
      } catch {
        // A proxy answered in the service's place.
        reject(problemOf(sent.status, sent.responseText));
      }
    };
    sent.onerror = () => {
      const broken = localProblem("The upload did not arrive", "The connection to the service broke.");
      // The file may have been deleted meanwhile: that has words of its own.
      readable(body).then(() => reject(broken), reject);
    };
    sent.onabort = () => reject(new DOMException("cancelled", "AbortError"));
    signal.addEventListener("abort", () => sent.abort());
    if (signal.aborted) return reject(new DOMException("cancelled", "AbortError"));
    sent.send(packed ?? body.content);
  });
}

/** Read a byte of each file of a body. Rejects where one has changed since it was chosen. */
async function readable({ content }: Body): Promise<void> {
  const parts = content instanceof Blob ? [content] : content.values();
  for (const part of parts) if (part instanceof Blob) await part.slice(0, 1).arrayBuffer();
}

/** Follow the job's events to its end. */
async function finished(
  location: string,
  signal: AbortSignal,
  tell: (progress: Progress) => void,
): Promise<void> {
  const response = await request(`${location}/events`, { signal });
  for await (const { event, data } of events(pieces(response, "No progress came"))) {
    if (event !== "progress") continue;
    const job = JSON.parse(data) as Job;
    if (job.state === "done") return;
    if (hasEnded(job)) throw failure(job);
    tell({
      step: job.state === "queued" ? "queue" : "refine",
      share: job.state === "queued" ? null : job.share,
      place: job.queue_place,
      stage: job.stage,
      estimate: job.estimate_seconds ?? null,
    });
  }
  // A proxy may cut a long stream: the job's own state decides.
  const job = (await (await request(location, { signal })).json()) as Job;
  if (hasEnded(job)) throw failure(job);
  if (job.state !== "done") return finished(location, signal, tell);
}

function hasEnded({ state }: Job): boolean {
  return state === "failed" || state === "cancelled";
}

/** Say why a job ended without a result. The service itself may have cancelled it. */
function failure({ state, problem }: Job): Problem {
  if (problem) return new Problem(problem);
  return state === "cancelled"
    ? localProblem("The service ended the job", "It may be stopping, or starting anew.")
    : localProblem("The job failed", "The service gave no reason.");
}

async function download(
  location: string,
  signal: AbortSignal,
  tell: (progress: Progress) => void,
): Promise<Answer> {
  const response = await request(`${location}/result`, {
    signal,
    // Its format was asked for with the job; a report is the other answer.
    headers: { Accept: "model/*" },
  });
  const total = Number(response.headers.get("Content-Length")) || null;
  const held: Uint8Array[] = [];
  let received = 0;
  for await (const piece of pieces(response, "No result came")) {
    held.push(piece);
    received += piece.length;
    tell({ step: "download", share: total ? received / total : null });
  }
  const bytes = await new Blob(held as BlobPart[]).arrayBuffer();
  return { bytes, timings: timings(response.headers.get("Server-Timing") ?? "") };
}

function timings(header: string): [string, number][] {
  return [...header.matchAll(/([\w-]+);dur=([\d.]+)/g)].map(([, name, ms]) => [
    name as string,
    Number(ms),
  ]);
}
