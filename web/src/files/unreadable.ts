/** What is said of a file that does not hold what its name says. */

import { fileProblem, type Problem } from "../api/problem";

/** `what` it should be; `error`: what its reader stopped at. */
export function unreadable(what: string, error: unknown): Problem {
  return fileProblem("The file cannot be read", `This is no ${what}: ${why(error)}`);
}

/** What a reader stopped at. What programs say where something is not there means nothing to anybody. */
export function why(error: unknown): string {
  if (error instanceof RangeError) return "it ends too early";
  if (error instanceof TypeError) return "something that has to be in it is not";
  // Whose reader it was is no help.
  return (error as Error).message.replace(/^THREE\.\w+: /, "");
}
