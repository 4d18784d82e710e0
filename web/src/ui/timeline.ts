/** Play, scrub, speed: one clock for both sides; and sliders for what morphs. */

import type { Model } from "../view/model";
import type { Playback } from "../view/playback";
import { element, input, make, option, select } from "./dom";

export class Timeline {
  constructor(
    private readonly playback: Playback,
    private readonly moved: () => void,
  ) {
    element("play").addEventListener("click", () => this.toggle());
    select("clip").addEventListener("change", () => this.choose(Number(select("clip").value)));
    input("scrub").addEventListener("input", () => {
      this.playback.playing = false;
      this.playback.seek(Number(input("scrub").value) * this.playback.duration);
      this.write();
      this.moved();
    });
    select("speed").addEventListener("change", () => {
      this.playback.speed = Number(select("speed").value);
    });
  }

  /** Offer a model's clips; the first is shown at rest, since motion is for the user to start. */
  offer(model: Model): void {
    const { clips } = model;
    element("timeline").hidden = !clips.length;
    select("clip").replaceChildren(
      option("-1", "At rest"),
      ...clips.map((clip, number) => option(String(number), clip.name || `Clip ${number + 1}`)),
    );
    this.playback.playing = false;
    this.playback.time = 0;
    this.choose(-1);
  }

  toggle(): void {
    if (element("timeline").hidden) return;
    if (this.playback.clip < 0) this.choose(0);
    this.playback.playing = !this.playback.playing;
    this.write();
    this.moved();
  }

  /** Show where the clock stands. */
  write(): void {
    const { playback } = this;
    const { time, duration, playing } = playback;
    element("play").setAttribute("aria-pressed", String(playing));
    input("scrub").value = String(duration ? time / duration : 0);
    input("scrub").setAttribute("aria-valuetext", `${time.toFixed(2)} seconds`);
    element("time").textContent = duration ? `${time.toFixed(2)} / ${duration.toFixed(2)} s` : "";
  }

  private choose(clip: number): void {
    select("clip").value = String(clip);
    this.playback.choose(clip);
    if (clip < 0) this.playback.playing = false;
    input("scrub").disabled = clip < 0;
    this.write();
    this.moved();
  }
}

/** One slider for each name of a morph target; `models` are asked when it moves. */
export function offerMorphs(model: Model, models: () => Model[], moved: () => void): void {
  const names = new Map<string, number>();
  for (const mesh of model.meshes) {
    for (const [name, target] of Object.entries(mesh.morphTargetDictionary ?? {})) {
      if (!names.has(name)) names.set(name, mesh.morphTargetInfluences?.[target] ?? 0);
    }
  }
  element("morphs").hidden = !names.size;
  element("morph-sliders").replaceChildren(
    ...[...names].map(([name, value]) => {
      const slider = make("input", { type: "range", min: "0", max: "1", step: "0.01" });
      slider.value = String(value);
      slider.addEventListener("input", () => {
        setMorph(models(), name, Number(slider.value));
        moved();
      });
      return make("label", { className: "slider" }, make("span", { textContent: titleOf(name) }), slider);
    }),
  );
}

/** A target without a name goes by its number, which counts from 0. */
function titleOf(name: string): string {
  return /^\d+$/.test(name) ? `Target ${Number(name) + 1}` : name;
}

/** Give a model that came later the weights of one that was there. */
export function copyMorphs(from: Model, to: Model): void {
  for (const [number, mesh] of to.meshes.entries()) {
    const weights = from.meshes[number]?.morphTargetInfluences;
    if (!weights || !mesh.morphTargetInfluences) continue;
    // Into the same array: lines over the mesh share it.
    weights.forEach((weight, target) => (mesh.morphTargetInfluences![target] = weight));
  }
}

function setMorph(models: Model[], name: string, value: number): void {
  for (const mesh of models.flatMap((model) => model.meshes)) {
    const target = mesh.morphTargetDictionary?.[name];
    if (target !== undefined) mesh.morphTargetInfluences![target] = value;
  }
}
