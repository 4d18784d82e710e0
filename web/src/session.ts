/** A file, what became of it, and the jobs under way. Knows no element of the page. */

import { refine, type Answer, type Progress } from "./api/jobs";
import { isAbort, Problem } from "./api/problem";
import { open, type Opened } from "./files/open";
import { jsonOf, parseGltf, type GltfJson } from "./files/gltf";
import { bodyOf, type Upload } from "./files/upload";
import type { Report } from "./report/report";
import { asLoop, LOOP, query, type Compression, type Diagnostics, type Settings } from "./settings";
import { isFinite, modelOf, type Model } from "./view/model";

export interface Result {
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

/** What the form makes of a file before it is refined. */
export type Prepare = (opened: Opened) => Promise<Settings>;

type Task = (signal: AbortSignal) => Promise<void>;

/** Another try at what failed. */
export type Again = () => void;

export interface Listener {
  progress(progress: Progress, what: string): void;
  /** A new file has taken the place of the old. */
  opened(source: Source): void;
  /** One was refused or cancelled, and the one before it is still there. */
  stayed(source: Source): void;
  refined(ours: Result): void;
  compared(loop: Result | null): void;
  idle(): void;
  failed(error: unknown, again: Again): void;
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
  private controller = new AbortController();
  /** How many tasks the controller ends. */
  private underWay = 0;
  /** Whether a refinement is among them. */
  private refining = false;
  /** A file that is not refined yet, beside the one that is shown. */
  private coming: Upload | null = null;
  /** Whose refinement was cancelled. */
  private stopped: Upload | null = null;

  constructor(private readonly listener: Listener) {}

  /** End all that is under way. */
  cancel(): void {
    const upload = this.coming ?? this.source?.upload;
    const { refining } = this;
    this.coming = null;
    this.refining = false;
    this.controller.abort();
    if (!refining || !upload) return;
    this.stopped = upload;
    this.listener.stopped(upload);
  }

  /** Refine what was cancelled after all. */
  async resume(settings: Settings, prepare: Prepare): Promise<void> {
    const { stopped } = this;
    if (stopped && stopped !== this.source?.upload) await this.take(stopped, prepare);
    else await this.again(settings, prepare);
  }

  /** Take a new file. What was there stays until the new one is refined. */
  async take(upload: Upload, prepare: Prepare): Promise<void> {
    this.coming = upload;
    const again = () => void this.take(upload, prepare);
    await this.only(again, async (signal) => {
      let source: Source | null = null;
      let settings: Settings;
      let ours: Result;
      try {
        const opened = await open(upload);
        source = { upload, opened, model: modelOf(opened.scene, opened.clips) };
        signal.throwIfAborted();
        settings = await prepare(opened);
        // Nothing is lost by showing the first file at once.
        if (this.source === null && isFinite(source.model)) this.show(source);
        ours = await this.run(upload, settings, signal);
      } catch (error) {
        if (!signal.aborted) this.coming = null;
        this.giveUp(source, error);
        throw error;
      }
      if (this.source !== source) this.show(source);
      await this.complete(upload, ours, settings, signal);
    });
  }

  /** Refine anew: the file that is on its way, or else the one that is there. */
  async again(settings: Settings, prepare: Prepare): Promise<void> {
    const { source, coming } = this;
    if (coming) return this.take(coming, prepare);
    if (!source) return;
    const anew = () => void this.again(settings, prepare);
    await this.only(anew, async (signal) => {
      // It is there already where Loop's side alone was cancelled.
      const there = this.ours?.key === query(settings).toString() ? this.ours : null;
      const ours = there ?? (await this.run(source.upload, settings, signal));
      await this.complete(source.upload, ours, settings, signal);
    });
  }

  /**
   * Another answer for the same settings; null when it was cancelled, or failed: `again` is what then
   * asks for it anew. Nothing under way ends for it.
   */
  async fetch(
    settings: Settings,
    diagnostics: Diagnostics,
    compress: Compression,
    again: Again,
  ): Promise<Answer | null> {
    const { source } = this;
    if (!source) return null;
    let answer: Answer | null = null;
    await this.beside(again, async (signal) => {
      const asked = query(settings, diagnostics, compress);
      answer = await refine(bodyOf(source.upload), asked, signal, (progress) =>
        this.listener.progress(progress, ""),
      );
    });
    return answer;
  }

  private async complete(
    upload: Upload,
    ours: Result,
    settings: Settings,
    signal: AbortSignal,
  ): Promise<void> {
    this.replace("ours", ours);
    const key = query(asLoop(settings)).toString();
    if (this.loop && this.loop.key !== key) this.replace("loop", null);
    this.listener.refined(ours);
    if (settings.model !== LOOP && !this.loop) {
      this.replace("loop", await this.run(upload, asLoop(settings), signal, "Loop’s side"));
    }
    this.listener.compared(this.loop);
  }

  private async run(
    upload: Upload,
    settings: Settings,
    signal: AbortSignal,
    what = "",
  ): Promise<Result> {
    const asked = query(settings);
    const answer = await refine(bodyOf(upload), asked, signal, (progress) =>
      this.listener.progress(progress, what),
    );
    return resultOf(asked.toString(), answer);
  }

  private show(source: Source): void {
    const old = this.source;
    this.coming = null;
    this.replace("ours", null);
    this.replace("loop", null);
    this.source = source;
    this.listener.opened(source);
    if (old) this.listener.discarded(old.model);
  }

  /** A new file was not refined: what was there before it stays. */
  private giveUp(source: Source | null, error: unknown): void {
    if (source && this.source === source) {
      if (isTheFiles(error)) this.clear();
      return;
    }
    if (source) this.listener.discarded(source.model);
    if (this.source && !this.coming) this.listener.stayed(this.source);
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
    this[side] = result;
    if (old && old !== result) this.listener.discarded(old.model);
  }

  /** Run a refinement after ending all that is under way. */
  private async only(again: Again, task: Task): Promise<void> {
    this.controller.abort();
    await this.beside(again, async (signal) => {
      this.refining = true;
      try {
        await task(signal);
      } finally {
        // Where it was ended, another may be under way.
        if (!signal.aborted) this.refining = false;
      }
    });
  }

  /** Run a task beside what is under way; what ends that ends it too. */
  private async beside(again: Again, task: Task): Promise<void> {
    if (this.controller.signal.aborted) {
      this.controller = new AbortController();
      this.underWay = 0;
    }
    const { controller } = this;
    const { signal } = controller;
    this.underWay++;
    try {
      await task(signal);
    } catch (error) {
      if (!signal.aborted && !isAbort(error)) this.listener.failed(error, again);
    } finally {
      if (this.controller === controller && --this.underWay === 0) this.listener.idle();
    }
  }
}

/** Whether an error is one of the file, which no other setting will mend. */
function isTheFiles(error: unknown): boolean {
  return error instanceof Problem && [400, 415, 422].includes(error.status) && !error.parameter;
}

async function resultOf(key: string, answer: Answer): Promise<Result> {
  const began = performance.now();
  const json = jsonOf(answer.bytes);
  const { scene, animations } = await parseGltf(answer.bytes);
  const timings: [string, number][] = [...answer.timings, ["opening", performance.now() - began]];
  return {
    key,
    bytes: answer.bytes,
    json,
    report: json.asset?.extras?.pns as Report,
    model: modelOf(scene, animations),
    timings,
    full: false,
  };
}
