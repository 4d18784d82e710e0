/** What a session works on, and whom it tells. */

import type { Progress } from "./api/jobs";
import type { Opened } from "./files/open";
import type { Upload } from "./files/upload";
import type { Order, Result } from "./result";
import type { Asked } from "./settings";
import type { Model } from "./view/model";

export interface Source {
  upload: Upload;
  opened: Opened;
  model: Model;
}

/** Turns an opened file into what is asked for it. Rejects where the service would refuse it. */
export type Prepare = (upload: Upload, opened: Opened, signal: AbortSignal) => Promise<Asked>;

/** Another try at what failed. */
export type Again = () => void;

/** Openings replace each other, and so do refinements; values at vertices belong to the result that is shown. */
export type Kind = "opening" | "refinement" | "values" | "download";

export interface Work {
  kind: Kind;
  /** The file that may be at fault; null where it was refined before. */
  upload: Upload | null;
  again: Again;
}

export type Task = (signal: AbortSignal) => Promise<void>;

/** What is on the stage. */
export interface Shown {
  source: Source | null;
  /** What was asked for the file first. */
  order: Order | null;
  ours: Result | null;
  loop: Result | null;
}

export const EMPTY: Shown = { source: null, order: null, ours: null, loop: null };

export interface Listener {
  /** `what` the work is for; empty where its result takes the place of the one that is shown. */
  progress(progress: Progress, what: string): void;
  /** A file takes the stage. */
  opened(source: Source): void;
  refined(ours: Result): void;
  compared(loop: Result | null): void;
  /** Other settings were refused or cancelled: the result before them stays. */
  stayed(ours: Result): void;
  /** What failed or was cancelled is asked for again. */
  renewed(asked: Asked): void;
  idle(): void;
  failed(error: unknown, work: Work): void;
  /** The user cancelled the work on a file; `again` starts it anew. */
  stopped(upload: Upload, again: Again): void;
  /** No file is left on the stage. */
  cleared(): void;
  discarded(model: Model): void;
}
