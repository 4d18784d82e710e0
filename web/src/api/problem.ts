/** What went wrong with a request, in the service's own words (RFC 9457) or in ours. */

export interface ProblemDocument {
  title: string;
  status: number;
  detail: string;
  code?: string;
  pointer?: string;
  parameter?: string;
}

export class Problem extends Error {
  readonly title: string;
  readonly status: number;
  readonly pointer: string | undefined;
  readonly parameter: string | undefined;

  constructor(document: ProblemDocument) {
    super(document.detail);
    this.title = document.title;
    this.status = document.status;
    this.pointer = document.pointer;
    this.parameter = document.parameter;
  }
}

/** A sentence of the page itself, of a server that does not answer: another try may do. */
export function localProblem(title: string, detail: string): Problem {
  return new Problem({ title, detail, status: 0 });
}

/** A sentence of the page itself, of a file that cannot be opened: it stays so however often it is tried. */
export function fileProblem(title: string, detail: string): Problem {
  return new Problem({ title, detail, status: 422 });
}

/** The problem that a failed answer describes; a proxy's page of HTML becomes a sentence. */
export function problemOf(status: number, text: string): Problem {
  try {
    const body = JSON.parse(text) as Partial<ProblemDocument>;
    if (typeof body.title === "string" && typeof body.detail === "string") {
      return new Problem({ ...body, title: body.title, detail: body.detail, status });
    }
  } catch {
    // Not JSON: said below.
  }
  return localProblem(`The server answered ${status}`, "It gave no further explanation.");
}

/** What to say of an error; null of one of the page's own. */
export function problemFrom(error: unknown): Problem | null {
  if (error instanceof Problem) return error;
  // Browsers keep the place of a file and not its bytes.
  if (!(error instanceof DOMException) || !["NotReadableError", "NotFoundError"].includes(error.name)) return null;
  return fileProblem("The file has changed", "It was written anew, moved or deleted since it was chosen: choose it again.");
}

export function isAbort(error: unknown): boolean {
  return error instanceof DOMException && error.name === "AbortError";
}
