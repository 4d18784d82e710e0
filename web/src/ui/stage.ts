/** The stage: which models stand on which side, how they look, and the tools under them. */

import { Box3, type Mesh } from "three";
import type { Unit } from "../report/format";
import type { Result } from "../result";
import type { Source } from "../tasks";
import { isLearned } from "../report/report";
import { colour, HEATS, needsFull, type Heat, type Legend } from "../view/heat";
import { removeLines, type Lines } from "../view/lines";
import { dress, plain, type Look } from "../view/looks";
import { dispose, extentOf, type Extent, type Model } from "../view/model";
import { Playback } from "../view/playback";
import { Viewer, type Layout } from "../view/viewer";
import { debounced, element, select } from "./dom";
import { bindKeys } from "./keys";
import { showLabels } from "./labels";
import { drawLegendBar, showLegend } from "./legend";
import { copyMorphs, offerMorphs, Timeline } from "./timeline";
import { drawLines, LINES } from "./overlays";
import { chooseView, chosenLayout, chosenView } from "./tools";
import { bindWipe } from "./wipe";

interface Shown {
  source: Source | null;
  ours: Result | null;
  loop: Result | null;
}

export class Stage {
  /** null where the browser has no WebGL. */
  readonly viewer: Viewer | null;
  private readonly playback = new Playback();
  private readonly timeline: Timeline;
  private shown: Shown = { source: null, ours: null, loop: null };
  private surface: Look = "material";
  private heat: Heat | null = null;
  private lines: Lines[] = [];
  private extent: Extent = { box: new Box3(), points: new Float32Array() };
  /** Where a link puts the camera, until there is a file to look at. */
  private awaited: string | null = null;
  private hasOpened = false;

  /** `wantFull` is called for values that the result does not hold yet. */
  constructor(
    private readonly wantFull: () => void,
    private readonly changed: () => void,
  ) {
    this.viewer = startViewer();
    this.timeline = new Timeline(this.playback, () => this.viewer?.invalidate());
    const setWipe = bindWipe((share) => {
      if (!this.viewer) return;
      this.viewer.wipe = share;
      this.viewer.invalidate();
    });
    if (this.viewer) {
      this.viewer.onFrame = (seconds) => {
        const moving = this.playback.advance(seconds);
        if (moving) this.timeline.write();
        return moving;
      };
      this.viewer.rig.onChosen = debounced(300, this.changed);
    }
    for (const id of ["layout", "pair", "look", ...LINES]) {
      element(id).addEventListener("change", () => {
        this.read();
        this.changed();
      });
    }
    // Where a clip has carried it, not where the file left it.
    element("frame").addEventListener("click", () => {
      const { source } = this.shown;
      if (source) this.viewer?.frame(extentOf(source.model));
      this.changed();
    });
    // Tools wrap into more lines where the window is narrow.
    const cover = new ResizeObserver(() => this.cover());
    for (const id of ["canvas", "tools", "timeline"]) cover.observe(element(id));
    bindKeys(this.viewer, this.timeline, setWipe);
    const dark = matchMedia("(prefers-color-scheme: dark)");
    dark.addEventListener("change", () => this.arrange());
    drawLegendBar();
  }

  /** The view's own settings, for the page's address. */
  get view(): Record<string, string> {
    const view = chosenView();
    const place = this.viewer?.rig.chosen ? this.viewer.rig.place(this.extent) : this.awaited;
    return place === null ? view : { ...view, camera: place };
  }

  set view(view: Record<string, string>) {
    chooseView(view);
    this.awaited = view.camera ?? null;
    this.read();
    if (this.shown.source) this.lookFromLink();
  }

  private lookFromLink(): void {
    if (this.awaited !== null) this.viewer?.rig.goTo(this.awaited, this.extent);
    this.awaited = null;
  }

  open(source: Source): void {
    // A heat map explains one result; that of a link is for the first file.
    if (this.hasOpened && this.heat) {
      select("look").value = this.surface;
      this.heat = null;
      this.changed();
    }
    this.hasOpened = true;
    this.shown = { source, ours: null, loop: null };
    this.playback.clear();
    this.adopt(source.model);
    this.extent = extentOf(source.model);
    this.timeline.offer(source.model);
    offerMorphs(source.model, () => this.models(), () => this.viewer?.invalidate());
    this.cover();
    const stale = this.viewer?.rig.chosen;
    this.viewer?.ground(this.extent);
    this.viewer?.frame(this.extent);
    this.lookFromLink();
    this.arrange();
    // The address has the last file's camera.
    if (stale) this.changed();
  }

  refine(ours: Result, loop: Result | null): void {
    const fresh = this.shown.ours !== ours;
    const news = loop && this.shown.loop !== loop ? loop : null;
    this.shown = { ...this.shown, ours, loop };
    for (const result of [fresh ? ours : null, news]) {
      if (!result) continue;
      // Materials without names are the service's own: both sides are to look alike.
      const isNamed = ({ material }: Mesh): boolean => [material].flat().some(({ name }) => name);
      if (this.shown.source?.opened.json === null) plain(result.model.meshes.filter((mesh) => !isNamed(mesh)));
      this.adopt(result.model);
      if (this.shown.source) copyMorphs(this.shown.source.model, result.model);
    }
    this.arrange();
  }

  discard(model: Model): void {
    // What was never shown, as of a file that was refused, has no lines.
    if (this.models().includes(model)) this.clearLines();
    this.playback.remove(model);
    dispose(model);
    if (this.shown.ours?.model === model) this.shown.ours = null;
    if (this.shown.loop?.model === model) this.shown.loop = null;
    if (this.shown.source?.model !== model) return;
    this.shown.source = null;
    // Another file brings its own.
    element("timeline").hidden = element("morphs").hidden = true;
  }

  /** The diagonal of the model's box. */
  get size(): number {
    const { box } = this.extent;
    return box.isEmpty() ? 1 : box.min.distanceTo(box.max) || 1;
  }

  get unit(): Unit {
    return this.shown.source?.opened.json ? "metre" : "unit";
  }

  private get layout(): Layout {
    return chosenLayout();
  }

  private adopt(model: Model): void {
    this.viewer?.add(model);
    this.playback.add(model);
  }

  private models(): Model[] {
    const { source, ours, loop } = this.shown;
    return [source?.model, ours?.model, loop?.model].filter((model) => model !== undefined);
  }

  private read(): void {
    const look = select("look").value;
    this.heat = HEATS.find((heat) => heat === look) ?? null;
    if (!this.heat) this.surface = look as Look;
    this.arrange();
  }

  /** Put everything where the tools say. */
  arrange(): void {
    const { source, ours, loop } = this.shown;
    const learned = ours && isLearned(ours.report);
    // One side alone is compared with nothing; over the result stand the control mesh's edges.
    select("pair").disabled = !learned || this.layout === "overlay" || this.layout === "single";
    // Faces that are made where they are needed have no counterparts, and no values.
    for (const choice of select("look").options) {
      choice.disabled = ours?.asked.settings.faces != null && ["distance", "gate", "ratio"].includes(choice.value);
    }
    // Until Loop's side has come the control mesh stands in its place, under its own name.
    const byLoop = select("pair").value === "loop" && learned && loop !== null;
    const left = (byLoop ? loop.model : source?.model) ?? null;
    const right = ours?.model ?? null;
    const paper = getComputedStyle(document.body).backgroundColor;
    element("view").dataset.layout = this.layout;
    showLabels(source, ours, byLoop ? loop : null, this.layout);
    element("wipe").hidden = !(this.layout === "wipe" && source && ours) || !this.viewer;
    showLegend(this.colourResult());
    if (!this.viewer) return;
    this.viewer.background(paper);
    const moved = this.viewer.layout !== this.layout;
    this.viewer.layout = this.layout;
    this.viewer.sides = { left, right };
    this.viewer.over = this.overlaid;
    this.viewer.caster = this.overlaid ? right : (source?.model ?? null);
    this.viewer.standsOnGround = this.surface === "material" || this.surface === "clay";
    for (const model of this.models()) {
      const look = this.lookOf(model);
      model.meshes.forEach((mesh) => dress(mesh, look, paper));
    }
    this.clearLines();
    this.lines = drawLines(this.models(), this.overlaid, (model) => this.lookOf(model), this.size);
    if (moved && (this.layout === "side" || this.layout === "wipe")) {
      this.viewer.frame(this.extent, false);
    }
    this.viewer.invalidate();
  }

  private lookOf(model: Model): Look {
    if (model === this.overlaid) return "hidden";
    const hot = model === this.shown.ours?.model && !element("legend").hidden;
    return hot ? "heat" : this.surface;
  }

  /** The control mesh, where only its edges are shown, over the result. */
  private get overlaid(): Model | null {
    const { source, ours } = this.shown;
    return this.layout === "overlay" && source && ours ? source.model : null;
  }

  private colourResult(): Legend | null {
    const { ours, loop } = this.shown;
    if (!this.heat || !ours) return null;
    if (needsFull(this.heat) && !ours.full && isLearned(ours.report)) {
      this.wantFull();
      return null;
    }
    return colour(this.heat, ours, loop, this);
  }

  /** Make room for the tools that float over the canvas, however many lines they take. */
  private cover(): void {
    const { bottom } = element("canvas").getBoundingClientRect();
    const above = (id: string) => bottom - (element(id).getBoundingClientRect().top || bottom);
    element("view").style.setProperty("--tools", `${Math.max(above("tools"), 0)}px`);
    if (!this.viewer) return;
    this.viewer.rig.covered = Math.max(above("tools"), above("timeline"), 0);
    if (!this.viewer.rig.chosen && this.shown.source) this.viewer.frame(this.extent, false);
    this.viewer.invalidate();
  }

  private clearLines(): void {
    removeLines(this.lines);
    this.lines = [];
  }
}

function startViewer(): Viewer | null {
  const canvas = element<HTMLCanvasElement>("canvas");
  const tell = (isMissing: boolean): void => void (element("no-webgl").hidden = !isMissing);
  try {
    const viewer = new Viewer(canvas);
    canvas.addEventListener("webglcontextlost", () => tell(true));
    canvas.addEventListener("webglcontextrestored", () => tell(false));
    return viewer;
  } catch {
    document.body.classList.add("no-webgl-here");
    tell(true);
    canvas.hidden = true;
    return null;
  }
}
