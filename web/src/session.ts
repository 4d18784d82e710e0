/** A file, what became of it, and the jobs under way. Knows no element of the page. */

import { refine, type Answer, type Progress } from "./api/jobs";
import { isAbort, localProblem, Problem } from "./api/problem";
import { open, type Opened } from "./files/open";
import { jsonOf, parseGltf, type GltfJson } from "./files/gltf";
import { bodyOf, type Upload } from "./files/upload";
import type { Report } from "./report/report";
import { asLoop, LOOP, query, type Asked, type Compression, type Diagnostics } from "./settings";
import { isFinite, modelOf, type Model } from "./view/model";

/** What is asked of the service. */
interface Order {
  upload: Upload;
  asked: Asked;
  /** When, by the page's clock. */
  began: number;
}

/** What came of an order, whatever has been asked for since. */
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

export interface Source {
  upload: Upload;
  opened: Opened;
  model: Model;
}

/** What the form makes of a file before it is refined; nothing of one that was ended meanwhile. */
export type Prepare = (upload: Upload, opened: Opened, signal: AbortSignal) => Promise<Asked>;

/** A refinement; what is asked for a new file is known once it is open. */
type Request = Omit<Order, "asked"> & { asked: Asked | null };

type Task = (signal: AbortSignal) => Promise<void>;

/** What is under way: values are for the heat map of what is shown, and end with it. */
type Kind = "refinement" | "values" | "download";

/** Another try at what failed. */
export type Again = () => void;

export interface Listener {
  progress(progress: Progress, what: string): void;
  /** A new file has taken the place of the old. */
  opened(source: Source): void;
  /** What was asked for was refused or cancelled: what was there before it still is. */
  stayed(): void;
  /** What was asked for before is asked for again. */
  renewed(upload: Upload, asked: Asked): void;
  refined(ours: Result): void;
  compared(loop: Result | null): void;
  idle(): void;
  /** `upload` is the file that is at fault. */
  failed(error: unknown, again: Again, upload: Upload | null): void;
  discarded(model: Model): void;
  /** The refinement of a file was cancelled. */
  stopped(upload: Upload): void;
  /** The file that was shown turned out to be broken. */
  cleared(): void;
}

export class Session {
  source: Source | null = null;
  ours: Result | null = null;
  loop: Result | null = null;
  /** Each task by what ends it. */
  private readonly underWay = new Map<AbortController, Kind>();
  /** The refinement among them. */
  private refining: Request | null = null;
  /** The one that was cancelled last. */
  private stopped: Request | null = null;

  constructor(private readonly listener: Listener) {}

  /** A file that is not refined yet, beside the one that is shown. */
  get coming(): Upload | null {
    const upload = this.refining?.upload ?? null;
    return upload === this.source?.upload ? null : upload;
  }

  /** End all that is under way. */
  cancel(): void {
    const { refining } = this;
    this.refining = null;
    this.end("refinement", "values", "download");
    if (!refining) return;
    this.stopped = refining;
    this.listener.stayed();
    this.listener.stopped(refining.upload);
  }

  /** Refine what was cancelled after all. */
  async resume(prepare: Prepare): Promise<void> {
    if (this.stopped) await this.renew(this.stopped, prepare);
  }

  /** Refine as it was asked for then, whatever has been asked for since. */
  private async renew({ upload, asked }: Request, prepare: Prepare): Promise<void> {
    if (asked) this.listener.renewed(upload, asked);
    if (asked && this.source?.upload === upload) await this.again(asked, prepare);
    else await this.take(upload, prepare);
  }

  /** Take a new file. What was there stays until the new one is refined. */
  async take(upload: Upload, prepare: Prepare): Promise<void> {
    const began = performance.now();
    const request: Request = { upload, asked: null, began };
    const anew = () => void this.renew(request, prepare);
    await this.only(request, anew, async (signal) => {
      let source: Source | null = null;
      let ours: Result;
      this.listener.progress({ step: "open", share: null }, "");
      try {
        const opened = await open(upload);
        source = { upload, opened, model: modelOf(opened.scene, opened.clips) };
        signal.throwIfAborted();
        const asked = (request.asked = await prepare(upload, opened, signal));
        // Nothing is lost by showing the first file at once.
        if (this.source === null && isFinite(source.model)) this.show(source);
        ours = await this.refine({ upload, asked, began }, signal);
      } catch (error) {
        this.giveUp(source, error, signal);
        throw error;
      }
      if (this.source !== source) this.show(source);
      await this.complete(ours, signal);
    });
    await this.makeUp(request, prepare);
  }

  /** Refine anew: the file that is on its way, or else the one that is there. */
  async again(asked: Asked, prepare: Prepare): Promise<void> {
    const { source, coming } = this;
    if (coming) return this.take(coming, prepare);
    if (!source) return;
    const order = { upload: source.upload, asked, began: performance.now() };
    const anew = () => void this.renew(order, prepare);
    await this.only(order, anew, async (signal) => {
      // It is there already where Loop's side alone was cancelled.
      const there = this.ours?.key === query(asked.settings).toString() ? this.ours : null;
      if (there) there.asked = asked;
      try {
        await this.complete(there ?? (await this.refine(order, signal)), signal);
      } catch (error) {
        // What was ended has given way to something else by now.
        if (!signal.aborted) this.listener.stayed();
        throw error;
      }
    });
    await this.makeUp(order, prepare);
  }

  /** What came to nothing may have ended what makes up the file that is shown: its result, or Loop's side of it. */
  private async makeUp(after: Request, prepare: Prepare): Promise<void> {
    const { source, ours, loop } = this;
    if (this.refining) return;
    if (source && !ours && after.upload !== source.upload) return this.take(source.upload, prepare);
    if (!ours || loop || ours.asked.settings.model === LOOP || after.asked === ours.asked) return;
    await this.again(ours.asked, prepare);
  }

  /**
   * Another answer for what made a result; null when it was cancelled, or failed: `again` is what then
   * asks for it anew. Nothing under way ends for it, and nothing that comes later ends it.
   */
  async fetch(
    ours: Result,
    diagnostics: Diagnostics,
    compress: Compression,
    again: Again,
  ): Promise<ArrayBuffer | null> {
    let bytes: ArrayBuffer | null = null;
    await this.run("download", again, async (signal) => {
      ({ bytes } = await this.answer(ours, query(ours.asked.settings, diagnostics, compress), signal));
    });
    return bytes;
  }

  /** A result with values at vertices, which a plain one does not hold: the same job with all diagnostics. */
  async full(ours: Result, again: Again): Promise<Model | null> {
    let model: Model | null = null;
    await this.run("values", again, async (signal) => {
      const { bytes } = await this.answer(ours, query(ours.asked.settings, "full"), signal);
      const { scene } = await shownIn("The heat map", () => parseGltf(bytes));
      model = modelOf(scene, []);
    });
    return model;
  }

  private async complete(ours: Result, signal: AbortSignal): Promise<void> {
    const { upload, began, asked } = ours;
    const loops = asLoop(asked);
    if (this.ours !== ours) {
      this.replace("ours", ours);
      if (this.loop && this.loop.key !== query(loops.settings).toString()) this.replace("loop", null);
      this.listener.refined(ours);
    }
    if (asked.settings.model !== LOOP && !this.loop) {
      this.replace("loop", await this.refine({ upload, asked: loops, began }, signal, "Loop’s side"));
    }
    this.listener.compared(this.loop);
  }

  private async refine(order: Order, signal: AbortSignal, what = ""): Promise<Result> {
    const answer = await this.answer(order, query(order.asked.settings), signal, what);
    const result = await shownIn(what || "The result", () => resultOf(order, answer));
    if (signal.aborted) this.listener.discarded(result.model);
    signal.throwIfAborted();
    return result;
  }

  private answer(
    { upload }: Order,
    asked: URLSearchParams,
    signal: AbortSignal,
    what = "",
  ): Promise<Answer> {
    return refine(bodyOf(upload), asked, signal, (progress) => this.listener.progress(progress, what));
  }

  private show(source: Source): void {
    const old = this.source;
    this.replace("ours", null);
    this.replace("loop", null);
    this.source = source;
    this.listener.opened(source);
    if (old) this.listener.discarded(old.model);
  }

  /** A new file was not refined: what was there before it stays. */
  private giveUp(source: Source | null, error: unknown, { aborted }: AbortSignal): void {
    if (source && this.source === source) {
      if (isTheFiles(error)) this.clear();
      return;
    }
    if (source) this.listener.discarded(source.model);
    // What was ended has given way to something else by now.
    if (!aborted) this.listener.stayed();
  }

  /** Back to a page without a file. */
  private clear(): void {
    const old = this.source;
    this.source = null;
    if (old) this.listener.discarded(old.model);
    this.listener.cleared();
  }

  private replace(side: "ours" | "loop", result: Result | null): void {
    const old = this[side];
    if (side === "ours" && old !== result) this.end("values");
    this[side] = result;
    if (old && old !== result) this.listener.discarded(old.model);
  }

  /** Run a refinement after ending the one that is under way. */
  private async only(request: Request, again: Again, task: Task): Promise<void> {
    this.end("refinement");
    this.refining = request;
    await this.run("refinement", again, async (signal) => {
      try {
        await task(signal);
      } finally {
        // Where it was ended, another may be under way.
        if (this.refining === request) this.refining = null;
      }
    }, request.upload);
  }

  private end(...kinds: Kind[]): void {
    for (const [controller, kind] of this.underWay) {
      if (!kinds.includes(kind)) continue;
      this.underWay.delete(controller);
      controller.abort();
    }
  }

  /** Run a task beside what is under way; `upload` is what may be at fault. */
  private async run(kind: Kind, again: Again, task: Task, upload: Upload | null = null): Promise<void> {
    const controller = new AbortController();
    const { signal } = controller;
    this.underWay.set(controller, kind);
    try {
      await task(signal);
    } catch (error) {
      if (!signal.aborted && !isAbort(error)) this.listener.failed(error, again, isTheFiles(error) ? upload : null);
    } finally {
      if (this.underWay.delete(controller) && !this.underWay.size) this.listener.idle();
    }
  }
}

/** Whether an error is one of the file, which no other setting will mend. */
function isTheFiles(error: unknown): boolean {
  return error instanceof Problem && [400, 415, 422].includes(error.status) && !error.parameter;
}

/** What is made of an answer. Where nothing can be, that is no fault of the user's file, and another try may do. */
async function shownIn<T>(what: string, make: () => Promise<T>): Promise<T> {
  try {
    return await make();
  } catch (error) {
    throw localProblem(`${what} cannot be shown`, (error as Error).message);
  }
}

async function resultOf(order: Order, answer: Answer): Promise<Result> {
  const began = performance.now();
  const json = jsonOf(answer.bytes);
  const report = json.asset?.extras?.pns as Report | undefined;
  if (!report) throw new Error("The answer has no report.");
  const { scene, animations } = await parseGltf(answer.bytes);
  const timings: [string, number][] = [...answer.timings, ["opening", performance.now() - began]];
  return {
    ...order,
    key: query(order.asked.settings).toString(),
    bytes: answer.bytes,
    json,
    report,
    model: modelOf(scene, animations),
    timings,
    full: false,
  };
}
