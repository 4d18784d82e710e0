/** One refinement: upload, queue, stages, download, all of one request. A signal cancels each of them. */

import { Broken, pieces, request } from "./client";
import { gzipped } from "./gzip";
import { Cut, parts } from "./multipart";
import { localProblem, Problem, type ProblemDocument } from "./problem";

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
  /** The connection broke, and this is the second try. */
  again?: boolean;
}

export interface Answer {
  bytes: ArrayBuffer;
  /** Milliseconds by stage, from Server-Timing. */
  timings: [string, number][];
}

interface Told {
  state: "queued" | "running";
  place: number | null;
  stage: string | null;
  share: number;
}

/** Before the second try: a proxy finds another replica meanwhile. */
const PAUSE_MS = 1000;

/** Refine a file. Where the connection breaks it is tried once more: nothing is kept for another to fetch. */
export async function refine(
  body: Body,
  query: URLSearchParams,
  signal: AbortSignal,
  tell: (progress: Progress) => void,
): Promise<Answer> {
  try {
    return await attempt(body, query, signal, tell);
  } catch (error) {
    if (!isBroken(error) || signal.aborted) throw error;
    await readable(body);
    tell({ step: "upload", share: null, again: true });
    await new Promise((resolve) => setTimeout(resolve, PAUSE_MS));
    signal.throwIfAborted();
    try {
      return await attempt(body, query, signal, (progress) => tell({ ...progress, again: true }));
    } catch (second) {
      if (!isBroken(second) || signal.aborted) throw second;
      throw localProblem("The connection broke twice", "Is the service running, and the network up?");
    }
  }
}

function isBroken(error: unknown): boolean {
  return error instanceof Broken || error instanceof Cut || (error instanceof Problem && error.status === 502);
}

async function attempt(
  body: Body,
  query: URLSearchParams,
  signal: AbortSignal,
  tell: (progress: Progress) => void,
): Promise<Answer> {
  tell({ step: "upload", share: null });
  const packed = await gzipped(body);
  const headers: Record<string, string> = { Accept: "multipart/mixed" };
  if (body.type) headers["Content-Type"] = body.type;
  if (packed) headers["Content-Encoding"] = "gzip";
  const sent = { method: "POST", body: packed ?? body.content, headers, signal };
  const response = await request(`subdivide?${query}`, sent);
  const type = response.headers.get("Content-Type") ?? "";
  let answer: Answer | null = null;
  const received = (bytes: number, total: number): void => tell({ step: "download", share: bytes / total });
  for await (const part of parts(pieces(response, "No result came"), type, received)) {
    if (part.name === "progress") tell(progressOf(json<Told>(part.bytes)));
    if (part.name === "problem") throw new Problem(json<ProblemDocument>(part.bytes));
    if (part.name === "file") {
      answer = { bytes: part.bytes, timings: timings(part.headers.get("server-timing") ?? "") };
    }
  }
  if (!answer) throw new Cut("no file came");
  return answer;
}

function progressOf({ state, place, stage, share }: Told): Progress {
  return state === "queued" ? { step: "queue", share: null, place } : { step: "refine", share, stage };
}

function json<T>(bytes: ArrayBuffer): T {
  return JSON.parse(new TextDecoder().decode(bytes)) as T;
}

/** Read a byte of each file of a body. Rejects where one has changed since it was chosen. */
async function readable({ content }: Body): Promise<void> {
  const files = content instanceof Blob ? [content] : content.values();
  for (const file of files) if (file instanceof Blob) await file.slice(0, 1).arrayBuffer();
}

function timings(header: string): [string, number][] {
  return [...header.matchAll(/([\w-]+);dur=([\d.]+)/g)].map(([, name, ms]) => [name as string, Number(ms)]);
}
