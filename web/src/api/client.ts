/** Requests to the service, relative to where the page itself came from. */

import { isAbort, localProblem, Problem, problemOf } from "./problem";

export interface Limits {
  body_bytes: number;
  faces: number;
  levels: { min: number; max: number };
  seconds?: number;
  /** Base schemes: the classic ones and those that this service adds. */
  schemes?: string[];
}

export interface ModelEntry {
  name: string;
  default: boolean;
  hash: string;
  budget: number;
  format: number;
  learned_levels?: number | null;
}

// Kept in memory alone: a reload forgets it.
let key = "";

export function useKey(value: string): void {
  key = value.trim();
}

export function headers(more: Record<string, string> = {}): Record<string, string> {
  return key ? { ...more, Authorization: `Bearer ${key}` } : more;
}

/** The address of a route: the page may live under a prefix, and this file is in its assets. */
export function address(path: string): string {
  return new URL(path.replace(/^\//, ""), new URL("..", import.meta.url)).href;
}

/** A connection that broke: another try may do. */
export class Broken extends Problem {
  constructor(title: string, detail: string) {
    super({ title, detail, status: 0 });
  }
}

/** Fetch a route; anything but success throws the Problem that the service describes. */
export async function request(path: string, init: RequestInit = {}): Promise<Response> {
  const sent = { ...init, headers: headers(init.headers as Record<string, string>) };
  let response: Response;
  try {
    response = await fetch(address(path), sent);
  } catch (error) {
    if (init.signal?.aborted) throw error;
    throw new Broken("The service does not answer", "Is it running, and the network up?");
  }
  if (!response.ok) throw problemOf(response.status, await response.text());
  return response;
}

/** An answer's body as it comes; `nothing` is the title of the problem that it has none. */
export async function* pieces(response: Response, nothing: string): AsyncGenerator<Uint8Array> {
  if (!response.body) throw localProblem(nothing, "The answer has no body.");
  // Safari's streams cannot be iterated over.
  const reader = response.body.getReader();
  try {
    for (let next = await reader.read(); !next.done; next = await reader.read()) yield next.value;
  } catch (error) {
    if (isAbort(error)) throw error;
    throw new Broken("The connection broke", "Is the service running, and the network up?");
  } finally {
    // Nobody may want the rest.
    void reader.cancel().catch(() => {});
  }
}

export async function json<T>(path: string, init: RequestInit = {}): Promise<T> {
  return (await (await request(path, init)).json()) as T;
}
