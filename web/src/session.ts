/** A file, its refinement, and the tasks under way. Touches no element of the page. */

import { refine, type Answer } from "./api/jobs";
import { isAbort, Problem } from "./api/problem";
import { open } from "./files/open";
import { parseGltf } from "./files/gltf";
import { Unreadable } from "./files/unreadable";
import { bodyOf, type Upload } from "./files/upload";
import { resultOf, shownIn, type Order, type Result } from "./result";
import { asLoop, DEFAULTS, LOOP, query, type Asked, type Classic, type Writing } from "./settings";
import { EMPTY, type Again, type Kind, type Listener, type Prepare, type Shown, type Source, type Task, type Work } from "./tasks";
import { isFinite, modelOf, type Model } from "./view/model";

export class Session {
  private shown: Shown = EMPTY;
  /** What was on the stage before the file that is shown, until the service has taken that file. */
  private before: Shown = EMPTY;
  private readonly underWay = new Map<AbortController, Work>();

  constructor(private readonly listener: Listener) {}

  get source(): Source | null {
    return this.shown.source;
  }

  get ours(): Result | null {
    return this.shown.ours;
  }

  get loop(): Result | null {
    return this.shown.loop;
  }

  /** End all that is under way. */
  cancel(): void {
    const stopped = [...this.underWay.values()].filter(({ upload }) => upload).at(-1);
    this.end("opening", "refinement", "values", "download");
    this.listener.idle();
    if (!stopped?.upload) return;
    this.forget();
    if (this.ours) this.listener.stayed(this.ours);
    this.listener.stopped(stopped.upload, stopped.again);
  }

  get isBusy(): boolean {
    return this.underWay.size > 0;
  }

  /** Open a file, show it, and refine it. */
  async take(upload: Upload, prepare: Prepare): Promise<void> {
    const began = performance.now();
    const again = (): void => void this.take(upload, prepare);
    this.end("opening");
    this.listener.progress({ step: "open", share: null }, "");
    let refined: Promise<void> | null = null;
    await this.run({ kind: "opening", upload, again }, async (signal) => {
      const source = await this.open(upload, signal);
      try {
        const order = { upload, asked: await prepare(upload, source.opened, signal), classic: classicOf(source), began };
        this.end("refinement", "values");
        this.show(source, order);
        refined = this.refineShown(order);
      } catch (error) {
        this.listener.discarded(source.model);
        throw error;
      }
    });
    await refined;
  }

  /** Refine the file that is shown with other settings. */
  async again(asked: Asked): Promise<void> {
    if (this.source) await this.refineShown({ upload: this.source.upload, asked, classic: classicOf(this.source), began: performance.now() });
  }

  /** Take a file that was never refined off the stage. */
  leave(): void {
    if (this.ours) return;
    this.drop(this.shown);
    this.shown = EMPTY;
    this.listener.cleared();
  }

  /**
   * Fetch another answer for the order of a result; null where it was cancelled or failed, and `again`
   * is the next try. Nothing else ends it, and it ends nothing else.
   */
  async fetch(ours: Result, writing: Writing, again: Again): Promise<ArrayBuffer | null> {
    let bytes: ArrayBuffer | null = null;
    await this.run({ kind: "download", upload: null, again }, async (signal) => {
      ({ bytes } = await this.answer(ours, query(ours.asked.settings, ours.classic, writing), signal, "for the download"));
    });
    return bytes;
  }

  /** Fetch a result with its values at vertices, by the same order with all diagnostics. */
  async full(ours: Result, again: Again): Promise<Model | null> {
    let model: Model | null = null;
    await this.run({ kind: "values", upload: null, again }, async (signal) => {
      const asked = query(ours.asked.settings, ours.classic, { diagnostics: "full" });
      const { bytes } = await this.answer(ours, asked, signal, "for the heat map");
      const { scene } = await shownIn("The heat map", () => parseGltf(bytes));
      model = modelOf(scene, []);
    });
    return model;
  }

  /** Open a file. Where the page cannot read it, the service's words say why. */
  private async open(upload: Upload, signal: AbortSignal): Promise<Source> {
    try {
      const opened = await open(upload);
      const model = modelOf(opened.scene, opened.clips);
      if (!isFinite(model)) throw new Unreadable("Some of its positions are no numbers.");
      return { upload, opened, model };
    } catch (error) {
      signal.throwIfAborted();
      if (error instanceof Unreadable) {
        const settings = { ...DEFAULTS, levels: 1, model: LOOP };
        await this.answer({ upload }, query(settings, "loop"), signal);
      }
      throw error;
    } finally {
      signal.throwIfAborted();
    }
  }

  private async refineShown(order: Order): Promise<void> {
    const again = (): void => {
      this.listener.renewed(order.asked);
      void this.refineShown(order);
    };
    this.end("refinement");
    await this.run({ kind: "refinement", upload: order.upload, again }, async (signal) => {
      try {
        await this.complete(order, signal);
      } catch (error) {
        // A task that was ended has given way to another.
        if (!signal.aborted) this.giveUp(error);
        throw error;
      }
    });
    await this.makeUp(order);
  }

  /** Refine what an order ended that was then refused or cancelled itself: the file before it, or the comparison. */
  private async makeUp({ asked }: Order): Promise<void> {
    const { order, ours, loop } = this.shown;
    const missing = ours ?? order;
    const isRefining = [...this.underWay.values()].some(({ kind }) => kind === "refinement");
    if (!missing || missing.asked === asked || isRefining) return;
    if (!ours || (!loop && ours.asked.settings.model !== LOOP)) await this.refineShown(missing);
  }

  private async complete(order: Order, signal: AbortSignal): Promise<void> {
    const isThere = this.ours?.key === query(order.asked.settings, order.classic).toString();
    const ours = isThere ? this.ours! : await this.refine(order, signal);
    // It is there already where Loop's side alone was cancelled.
    ours.asked = order.asked;
    const loops = { ...order, asked: asLoop(order.asked), classic: ours.classic };
    if (!isThere) {
      this.replace("ours", ours);
      if (this.loop && this.loop.key !== query(loops.asked.settings, loops.classic).toString()) this.replace("loop", null);
      this.forget();
      this.listener.refined(ours);
    }
    if (order.asked.settings.model !== LOOP && !this.loop) {
      this.replace("loop", await this.refine(loops, signal, "for comparison"));
    }
    this.listener.compared(this.loop);
  }

  private async refine(order: Order, signal: AbortSignal, what = ""): Promise<Result> {
    const answer = await this.answer(order, query(order.asked.settings, order.classic), signal, what);
    const result = await shownIn(what ? "The comparison" : "The result", () => resultOf(order, answer));
    if (signal.aborted) this.listener.discarded(result.model);
    signal.throwIfAborted();
    return result;
  }

  private answer({ upload }: Pick<Order, "upload">, asked: URLSearchParams, signal: AbortSignal, what = ""): Promise<Answer> {
    return refine(bodyOf(upload), asked, signal, (progress) => this.listener.progress(progress, what));
  }

  private show(source: Source, order: Order): void {
    // Of several files that came too soon after each other the first stays to go back to.
    if (this.ours || !this.before.source) {
      this.forget();
      this.before = this.shown;
    } else {
      this.drop(this.shown);
    }
    this.shown = { source, order, ours: null, loop: null };
    this.listener.opened(source);
  }

  /** Go back to what was there before, if the service refused the file or its settings. */
  private giveUp(error: unknown): void {
    if (this.ours) this.listener.stayed(this.ours);
    if (this.ours || !isTheFiles(error)) return;
    const { shown, before } = this;
    this.before = EMPTY;
    this.shown = before;
    this.drop(shown);
    if (before.source) this.listener.opened(before.source);
    else this.listener.cleared();
    if (!before.ours) return;
    this.listener.refined(before.ours);
    this.listener.compared(before.loop);
    this.listener.stayed(before.ours);
  }

  private forget(): void {
    this.drop(this.before);
    this.before = EMPTY;
  }

  private drop({ source, ours, loop }: Shown): void {
    for (const part of [source, ours, loop]) if (part) this.listener.discarded(part.model);
  }

  private replace(side: "ours" | "loop", result: Result | null): void {
    const old = this.shown[side];
    if (side === "ours" && old !== result) this.end("values");
    this.shown = { ...this.shown, [side]: result };
    if (old && old !== result) this.listener.discarded(old.model);
  }

  private end(...kinds: Kind[]): void {
    for (const [controller, { kind }] of this.underWay) {
      if (!kinds.includes(kind)) continue;
      this.underWay.delete(controller);
      controller.abort();
    }
  }

  /** Run a task beside what is under way. */
  private async run(work: Work, task: Task): Promise<void> {
    const controller = new AbortController();
    const { signal } = controller;
    this.underWay.set(controller, work);
    try {
      await task(signal);
    } catch (error) {
      if (!signal.aborted && !isAbort(error)) this.listener.failed(error, work);
    } finally {
      if (this.underWay.delete(controller) && !this.underWay.size) this.listener.idle();
    }
  }
}

function classicOf({ opened }: Source): Classic {
  return opened.polygons ? "catmull-clark" : "loop";
}

/** Whether an error is one of the file, which no other setting mends. */
export function isTheFiles(error: unknown): boolean {
  return error instanceof Problem && [400, 415, 422].includes(error.status) && !error.parameter;
}
