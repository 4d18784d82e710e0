/** The form of settings: what may be chosen for this file, on this service. */

import type { Limits, ModelEntry } from "../api/client";
import type { Opened } from "../files/open";
import { count, counted } from "../report/format";
import { CHOICES, DEFAULTS, isClassic, learns, LOOP, SCHEME, SWITCHES, type Asked, type Settings } from "../settings";
import { element, input, option, select } from "./dom";
import { describeModel, ruleName } from "./models";

/** Faces of a rigged file from which on it is heavy. */
const HEAVY = 50_000;
/** In the list of levels: faces only where the surface bends. */
const BENDS = "bends";
/** Round numbers of faces: 10 to 5 million. */
const STOPS = [10, 100, 1e3, 1e4, 1e5, 1e6].flatMap((ten) => [ten, 2 * ten, 5 * ten]);
/** The most faces of one that the slider offers: those of five steps. */
const FINEST = 4 ** 5;

/** What counts of a file. */
type Faces = Pick<Opened, "split" | "polygons">;
const NO_FACES: Faces = { split: 0, polygons: false };

export class SettingsForm {
  private models: ModelEntry[] = [];
  private limits: Limits | null = null;
  /** What the user wants for any file. */
  private wanted: Settings;
  /** The same, with the levels that the file and the service leave open. */
  private settings: Settings;
  private file = NO_FACES;
  /** Whether the file moves by joints: games count its faces. */
  rigged = false;

  constructor(
    wanted: Settings,
    private readonly changed: () => void,
  ) {
    this.wanted = { ...wanted };
    this.settings = { ...wanted };
    const form = element<HTMLFormElement>("settings");
    form.addEventListener("submit", (event) => event.preventDefault());
    const read = ({ target }: Event): void => {
      if (target === input("pin")) return;
      // The browser says what is wrong with a number, in the user's language.
      if (target instanceof HTMLInputElement && !target.reportValidity()) return;
      this.read(target);
    };
    form.addEventListener("input", read);
    input("strength").addEventListener("input", read);
    element("offer").addEventListener("click", () => {
      select("levels").value = BENDS;
      this.read(select("levels"));
      select("levels").focus();
    });
    this.write();
  }

  offerModels(models: ModelEntry[]): void {
    this.models = models;
    this.write();
  }

  offerLimits(limits: Limits): void {
    this.limits = limits;
    this.write();
  }

  /** In bytes; Infinity while the service has named no limit. */
  get largestUpload(): number {
    return this.limits?.body_bytes ?? Infinity;
  }

  get asked(): Asked {
    return { settings: { ...this.settings }, wanted: { ...this.wanted } };
  }

  want(wanted: Settings): void {
    this.wanted = { ...wanted };
    this.fit(this.file);
  }

  /** Close the levels that would make a file too large. */
  fit(file: Faces = NO_FACES): void {
    this.show({ settings: this.wanted, wanted: this.wanted }, file);
  }

  /** Show what was asked for a file. */
  show(asked: Asked, file: Faces = NO_FACES): void {
    this.wanted = { ...asked.wanted };
    this.settings = { ...asked.settings };
    this.file = file;
    if (this.settings.faces !== null) this.settings.faces = this.nearestStop(this.settings.faces);
    const deepest = this.levels().filter((level) => !this.refusal(level));
    this.settings.levels = Math.min(this.settings.levels, deepest.at(-1) ?? 1);
    this.write();
  }

  private levels(): number[] {
    const { min, max } = this.limits?.levels ?? { min: 1, max: 6 };
    return Array.from({ length: max - min + 1 }, (_, i) => min + i);
  }

  private predicted(level: number): number {
    return this.file.split * 4 ** (level - 1);
  }

  /** Numbers of faces that the slider offers; none where faces of several levels cannot be. */
  private get stops(): number[] {
    const faces = this.file.split / 4 || 1000;
    const most = Math.min(this.limits?.faces ?? Infinity, FINEST * faces);
    return this.file.polygons ? [] : STOPS.filter((stop) => stop >= faces && stop <= most);
  }

  /** Return the largest stop that is no more than a number of faces; the first where there is none. */
  private nearestStop(faces: number): number | null {
    return this.stops.findLast((stop) => stop <= faces) ?? this.stops[0] ?? null;
  }

  /** Say why a level is closed; empty where it is open. */
  private refusal(level: number): string {
    const most = this.limits?.faces;
    return most && this.predicted(level) > most ? `over the limit of ${count(most)} faces` : "";
  }

  /** Say why every level is closed to the file; empty where one is open. */
  get refused(): string {
    const [first = 1] = this.levels();
    const refusal = this.refusal(first);
    return refusal && `${count(this.predicted(first))} faces after ${first} step, ${refusal} of this service`;
  }

  private get model(): ModelEntry | undefined {
    const { model } = this.settings;
    return this.models.find((entry) => (model ? entry.name === model : entry.default));
  }

  private write(): void {
    const { settings, stops } = this;
    select("levels").replaceChildren(
      ...this.levels().map((level) => {
        const faces = this.file.split ? ` · ${count(this.predicted(level))} faces` : "";
        const isClosed = this.refusal(level) !== "";
        return option(String(level), isClosed ? `${level} · too many faces` : `${level}${faces}`, isClosed);
      }),
      option(BENDS, `Only where it bends${this.file.polygons ? ": for triangles" : ""}`, !stops.length),
    );
    select("levels").value = settings.faces === null ? String(settings.levels) : BENDS;
    input("detail").max = String(Math.max(stops.length - 1, 0));
    input("detail").value = String(stops.indexOf(settings.faces ?? this.nearestStop(this.file.split) ?? 0));
    const bundled = this.models.map((model) =>
      option(model.default ? "" : model.name, ruleName(model)),
    );
    if (!bundled.length) bundled.push(option("", "Learned"));
    const added = (this.limits?.schemes ?? []).filter((name) => !isClassic(name)).map((name) => option(SCHEME + name, name));
    select("model").replaceChildren(...bundled, option(LOOP, "Classic"), ...added);
    select("model").value = settings.model;
    // Before the lists are there, a link may name a rule of them.
    const isUnknown = select("model").value !== settings.model && this.models.length > 0 && this.limits !== null;
    if (isUnknown) select("model").value = settings.model = this.wanted.model = "";
    input("angle").value = String(settings.angle);
    for (const name of Object.keys(CHOICES) as (keyof typeof CHOICES)[]) select(name).value = settings[name];
    for (const name of SWITCHES) input(name).checked = settings[name];
    this.adjust();
  }

  /** Read the form after a change of `target`. */
  private read(target: EventTarget | null): void {
    const before = this.settings;
    const bends = select("levels").value === BENDS;
    const angle = input("angle");
    const own = this.model?.budget ?? 0;
    const share = Number(input("strength").value) / 100;
    const settings: Settings = {
      ...before,
      levels: bends ? before.levels : Number(select("levels").value),
      faces: bends ? this.stops[Number(input("detail").value)] ?? null : null,
      model: select("model").value,
      // A link may hold any number: it stays until the strength itself is moved.
      budget: target !== input("strength") ? before.budget : share === 1 ? null : share * own,
      angle: angle.validity.valid ? Number(angle.value || DEFAULTS.angle) : before.angle,
    };
    Object.assign(settings, Object.fromEntries(Object.keys(CHOICES).map((name) => [name, select(name).value])));
    Object.assign(settings, Object.fromEntries(SWITCHES.map((name) => [name, input(name).checked])));
    // Each model has its own budget.
    if (target === select("model")) settings.budget = null;
    const isNew = ([name, value]: [string, unknown]) => value !== before[name as keyof Settings];
    Object.assign(this.wanted, Object.fromEntries(Object.entries(settings).filter(isNew)));
    this.settings = settings;
    this.adjust();
    this.changed();
  }

  /** Show what follows from the other settings. */
  private adjust(): void {
    const { settings, model } = this;
    const closed = this.levels().find((level) => this.refusal(level));
    const bends = settings.faces !== null;
    const isHeavy = !bends && this.rigged && settings.levels > 1 && this.predicted(settings.levels) > HEAVY;
    element("levels-note").textContent = closed && !bends && this.wanted.levels >= closed
      ? `${closed} and more: ${this.refusal(closed)} of this service`
      : isHeavy ? "Many faces for a game." : "";
    const offer = isHeavy && this.nearestStop(this.file.split);
    element("offer").hidden = !offer;
    element("offer").textContent = offer ? `Only where it bends: at most ${counted(offer, "face")}` : "";
    element("detail-row").hidden = !bends;
    element("detail-text").textContent = bends ? `≤ ${count(settings.faces!)}` : "";
    input("detail").ariaValueText = bends ? `at most ${counted(settings.faces!, "face")}` : "";
    for (const id of ["limit", "polygons"]) input(id).disabled = bends;
    select("uv").disabled = bends;
    const share = settings.budget === null || !model ? 1 : settings.budget / model.budget;
    const percent = Math.round(100 * share);
    input("strength").value = String(percent);
    input("strength").disabled = !learns(settings) || !model;
    element("strength-text").textContent = learns(settings) ? `${percent} %` : "–";
    element("kept").hidden = Object.entries(this.wanted).every(([name, value]) => value === DEFAULTS[name as keyof Settings]);
    element("angle-row").hidden = settings.crease !== "angle";
    element("model-note").textContent = describeModel(learns(settings) ? model?.name ?? "" : settings.model);
  }
}
