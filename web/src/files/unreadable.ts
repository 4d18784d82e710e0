/** Files that do not hold what their names say. */

import { Problem } from "../api/problem";

/** A file that the page cannot read or draw. The service may have better words for it. */
export class Unreadable extends Problem {
  constructor(detail: string) {
    super({ title: "The file cannot be read", detail, status: 422 });
  }
}

/** Return the problem with a file; `what` is what its name promises, `error` where its reader stopped. */
export function unreadable(what: string, error: unknown): Unreadable {
  return new Unreadable(`This is no ${what}: ${why(error)}`);
}

/** Say where a reader stopped. A runtime error's own message means nothing to a user. */
export function why(error: unknown): string {
  if (error instanceof RangeError) return "it ends too early";
  if (error instanceof TypeError) return "something that has to be in it is not";
  return (error as Error).message.replace(/^THREE\.\w+: /, "");
}
