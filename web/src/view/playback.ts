/** One clock for all models: the same clip at the same time on both sides. */

import { AnimationMixer } from "three";
import type { Model } from "./model";

export class Playback {
  time = 0;
  speed = 1;
  playing = false;
  /** Which clip; -1 leaves the models at rest. */
  clip = -1;

  private readonly mixers = new Map<Model, AnimationMixer>();

  add(model: Model): void {
    if (!model.clips.length) return;
    this.mixers.set(model, new AnimationMixer(model.root));
    if (this.clip >= 0) this.choose(this.clip);
  }

  remove(model: Model): void {
    const mixer = this.mixers.get(model);
    mixer?.stopAllAction();
    mixer?.uncacheRoot(model.root);
    this.mixers.delete(model);
  }

  clear(): void {
    for (const model of [...this.mixers.keys()]) this.remove(model);
  }

  get duration(): number {
    const [model] = this.mixers.keys();
    return model?.clips[this.clip]?.duration ?? 0;
  }

  choose(clip: number): void {
    this.clip = clip;
    for (const [model, mixer] of this.mixers) {
      mixer.stopAllAction();
      const chosen = model.clips[clip];
      if (chosen) mixer.clipAction(chosen).play();
    }
    this.seek(Math.min(this.time, this.duration));
  }

  seek(time: number): void {
    this.time = time;
    // Played clips loop, so the very end would be shown as the beginning.
    const shown = Math.min(time, Math.max(this.duration - 1e-6, 0));
    if (this.clip >= 0) for (const mixer of this.mixers.values()) mixer.setTime(shown);
  }

  /** Let `seconds` pass; returns whether anything moves. */
  advance(seconds: number): boolean {
    if (!this.playing || this.clip < 0 || !this.duration) return false;
    this.seek((this.time + seconds * this.speed) % this.duration);
    return true;
  }
}
