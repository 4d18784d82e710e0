/** What is said of a file that does not hold what its name says. */

import { fileProblem, type Problem } from "../api/problem";

/** `what` it should be; `error`: what its reader stopped at. */
export function unreadable(what: string, error: unknown): Problem {
  // What a reader of binary data says where it runs over the end means nothing to anybody.
  const why = error instanceof RangeError ? "it ends too early" : (error as Error).message;
  return fileProblem("The file cannot be read", `This is no ${what}: ${why}`);
}
