/** Parts of the page that come when they are needed. */

import { localProblem } from "./problem";

/** A part, once it is here; `coming` is its import. */
export async function part<T>(coming: Promise<T>): Promise<T> {
  try {
    return await coming;
  } catch {
    // An update of the service leaves other names than those that this page knows.
    throw localProblem(
      "A part of the page did not come",
      // Many browsers ask for a part once, and remember that it did not come.
      "Is the service running, and the network up? Where another try does not help, reload the page.",
    );
  }
}
