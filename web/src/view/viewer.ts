/** One canvas, one camera, one or two models, drawn when something changed. */

import {
  Color,
  NeutralToneMapping,
  Raycaster,
  Scene,
  Vector2,
  WebGLRenderer,
} from "three";
import { light, paint, surround } from "./lights";
import { Rig } from "./rig";
import { ContactShadow } from "./shadow";
import { drawnBySoftware } from "./software";
import type { Extent, Model } from "./model";

export type Layout = "wipe" | "side" | "overlay" | "single";

/** Milliseconds without a change after which a picture may take its time. */
const REST = 200;

export interface Sides {
  left: Model | null;
  right: Model | null;
}

export class Viewer {
  readonly renderer: WebGLRenderer;
  readonly rig: Rig;
  sides: Sides = { left: null, right: null };
  /** Drawn together with the right side: lines over it. */
  over: Model | null = null;
  layout: Layout = "wipe";
  /** Where the wipe stands, 0 to 1 from the left. */
  wipe = 0.5;
  /** Whether models stand on a ground, and cast a shadow there. */
  standsOnGround = false;
  /** What casts the shadow, on both sides. */
  caster: Model | null = null;
  /** Called once a frame with the seconds since the last; returns whether it wants another. */
  onFrame: (seconds: number) => boolean = () => false;

  // Without a card, edges are smoothed by finer pixels, and only once nothing moves.
  private readonly software = drawnBySoftware();
  private readonly scene = new Scene();
  private readonly shadow = new ContactShadow();
  private readonly paper = new Color();
  private scheduled = false;
  private last = 0;
  private frames = 0;
  private rest = 0;

  /** Throws where the browser has no WebGL. */
  constructor(readonly canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: !this.software });
    this.renderer.autoClear = false;
    this.renderer.toneMapping = NeutralToneMapping;
    this.rig = new Rig(canvas, () => this.invalidate());
    light(this.renderer, this.scene, this.rig.camera, this.software);
    this.scene.add(this.shadow.ground);
    canvas.addEventListener("dblclick", (event) => this.centreAt(event));
    canvas.addEventListener("webglcontextrestored", () => {
      if (!this.software) surround(this.renderer, this.scene);
      this.invalidate();
    });
    new ResizeObserver(() => this.invalidate()).observe(canvas);
  }

  add(model: Model): void {
    if (this.software) paint(model.meshes);
    this.scene.add(model.root);
    this.invalidate();
  }

  background(colour: string): void {
    this.paper.set(colour);
    this.invalidate();
  }

  /** Draw soon, and once however often it is asked for. */
  invalidate(): void {
    if (this.scheduled) return;
    this.scheduled = true;
    clearTimeout(this.rest);
    requestAnimationFrame((now) => {
      this.scheduled = false;
      // After a pause the clock does not jump.
      const seconds = Math.min((now - this.last) / 1000, 0.1);
      this.last = now;
      const again = this.onFrame(seconds);
      this.draw(!this.software);
      if (again) this.invalidate();
      else if (this.software) this.settle();
    });
  }

  /** Draw finely once nothing has asked for a picture in a while. */
  private settle(): void {
    this.rest = window.setTimeout(() => requestAnimationFrame(() => this.draw(true)), REST);
  }

  /** Look at all of a model; `turn` goes back to the first direction. */
  frame(extent: Extent, turn = true): void {
    const { width } = this.size();
    this.rig.frame(extent, this.layout === "side" ? width / 2 : width, turn);
  }

  /** Lay the ground under a model. */
  ground({ box }: Extent): void {
    if (!box.isEmpty()) this.shadow.place(box);
  }

  /** The view as a PNG, at the canvas's own size. */
  picture(): Promise<Blob> {
    // The buffer is gone once the browser has shown it, so it is drawn anew and read at once.
    this.draw(true);
    return new Promise((resolve, reject) =>
      this.canvas.toBlob((blob) => (blob ? resolve(blob) : reject(new Error("no picture")))),
    );
  }

  private size(): { width: number; height: number } {
    return { width: this.canvas.clientWidth || 1, height: this.canvas.clientHeight || 1 };
  }

  private draw(finely: boolean): void {
    const { width, height } = this.size();
    const ratio = this.software ? (finely ? 2 : 1) : Math.min(window.devicePixelRatio, 2);
    const drawn = this.renderer.getSize(new Vector2());
    if (drawn.x !== width || drawn.y !== height || this.renderer.getPixelRatio() !== ratio) {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
    }
    const { left, right } = this.sides;
    // Software draws it once nothing moves, and until then as it was.
    if (finely && this.standsOnGround) this.castShadow();
    const split = Math.round(this.wipe * width);
    if (!left || !right || this.layout === "overlay" || this.layout === "single") {
      this.view(right ?? left, 0, width, 0, width);
    } else if (this.layout === "side") {
      this.view(left, 0, width / 2, 0, width / 2);
      this.view(right, width / 2, width / 2, width / 2, width / 2);
    } else {
      this.view(left, 0, width, 0, split);
      this.view(right, 0, width, split, width - split);
    }
    this.tell();
  }

  /** Say on the canvas how often it was drawn, and what the card holds: growth would be a leak. */
  private tell(): void {
    const { geometries, textures } = this.renderer.info.memory;
    this.canvas.dataset.held = `${geometries} geometries, ${textures} textures`;
    this.canvas.dataset.frames = String(++this.frames);
  }

  /** Draw one model over the columns from `x`, and of those the ones from `from`. */
  private view(model: Model | null, x: number, width: number, from: number, columns: number): void {
    if (columns <= 0) return;
    const { height } = this.size();
    const { renderer, scene, shadow } = this;
    this.showOnly(model);
    renderer.setClearColor(this.paper);
    shadow.ground.visible = model !== null && this.standsOnGround;
    renderer.setScissorTest(true);
    renderer.setViewport(x, 0, width, height);
    renderer.setScissor(from, 0, columns, height);
    renderer.clear();
    if (!model) return;
    this.rig.project(width, height);
    renderer.render(scene, this.rig.camera);
  }

  private castShadow(): void {
    this.showOnly(this.caster);
    if (this.caster) this.shadow.render(this.renderer, this.scene);
  }

  private showOnly(model: Model | null): void {
    for (const object of this.scene.children) {
      if (object === this.rig.camera || "isLight" in object) continue;
      object.visible = object === model?.root || object === this.over?.root;
    }
  }

  private centreAt(event: MouseEvent): void {
    const box = this.canvas.getBoundingClientRect();
    const { left, right } = this.sides;
    let [x, width] = [event.clientX - box.left, box.width];
    let model = right ?? left;
    if (left && right && this.layout === "side") {
      width /= 2;
      model = x < width ? left : right;
      x %= width;
    } else if (left && right && this.layout === "wipe" && x < this.wipe * width) {
      model = left;
    }
    if (!model) return;
    const at = new Vector2((2 * x) / width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
    const caster = new Raycaster();
    this.rig.project(width, box.height);
    caster.setFromCamera(at, this.rig.camera);
    const hit = caster.intersectObjects(model.meshes, false)[0];
    if (hit) this.rig.centreOn(hit.point);
  }
}
