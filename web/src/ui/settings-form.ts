/** The form of settings: what may be chosen for this file, on this service. */

import type { Limits, ModelEntry } from "../api/client";
import type { Opened } from "../files/open";
import type { Upload } from "../files/upload";
import { count } from "../report/format";
import { DEFAULTS, LOOP, type Asked, type Settings } from "../settings";
import { element, input, option, select } from "./dom";

/** A file, as far as settings depend on it. */
interface Facts {
  upload: Upload;
  opened: Pick<Opened, "faces" | "normals">;
}

export class SettingsForm {
  private models: ModelEntry[] = [];
  private limits: Limits | null = null;
  /** What the user wants of any file. */
  private wanted: Settings;
  /** What the form says: that, as far as the file has it. */
  private settings: Settings;
  private file: Upload | null = null;
  private faces = 0;

  constructor(
    wanted: Settings,
    private readonly changed: () => void,
  ) {
    this.wanted = { ...wanted };
    this.settings = { ...wanted };
    const form = element<HTMLFormElement>("settings");
    form.addEventListener("submit", (event) => event.preventDefault());
    form.addEventListener("input", ({ target }) => {
      // The browser says what is wrong with a number, in the user's language.
      if (target instanceof HTMLInputElement && !target.reportValidity()) return;
      // Each model has its own budget: a number meant for another is let go.
      if (target === select("model")) input("budget").value = "";
      // Normals of the limit surface stand on the limit surface, and nowhere else.
      if (target === input("limit") && !input("limit").checked && select("normals").value === "limit") {
        select("normals").value = "smooth";
      }
      this.read();
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

  /** Bytes; without a limit where the service has named none. */
  get largestUpload(): number {
    return this.limits?.body_bytes ?? Infinity;
  }

  get asked(): Asked {
    return { settings: { ...this.settings }, wanted: { ...this.wanted } };
  }

  /** Say what the user wants of any file. */
  want(wanted: Settings): void {
    this.wanted = { ...wanted };
    this.fit(null);
  }

  /** Make the form that of a file. What the user then chooses for it stays, however often it is fitted to the same. */
  fit(file: Facts | null): void {
    if (!file || this.file !== file.upload) {
      this.settings = { ...this.wanted };
      // It would come back faceted: nobody refines for that.
      if (file && !file.opened.normals && this.settings.normals === "keep") this.settings.normals = "smooth";
    }
    this.begin(file?.upload ?? null, file?.opened.faces ?? 0);
  }

  /** Say again what was asked for a file; 0 faces where they are not known yet. */
  show(asked: Asked, upload: Upload, faces: number): void {
    this.wanted = { ...asked.wanted };
    this.settings = { ...asked.settings };
    this.begin(upload, faces);
  }

  /** Levels beyond the service's limits close. */
  private begin(upload: Upload | null, faces: number): void {
    this.file = upload;
    this.faces = faces;
    const deepest = this.levels().filter((level) => !this.refusal(level));
    this.settings.levels = Math.min(this.settings.levels, deepest.at(-1) ?? 1);
    this.write();
  }

  private levels(): number[] {
    const { min, max } = this.limits?.levels ?? { min: 1, max: 6 };
    return Array.from({ length: max - min + 1 }, (_, i) => min + i);
  }

  private predicted(level: number): number {
    return this.faces * 4 ** level;
  }

  /** Why a level is closed; empty where it is open. */
  private refusal(level: number): string {
    const most = this.limits?.faces;
    return most && this.predicted(level) > most ? `over the limit of ${count(most)} faces` : "";
  }

  /** Why no level at all is open to the file; empty where one is. */
  get refused(): string {
    const [first = 1] = this.levels();
    const refusal = this.refusal(first);
    return refusal && `${count(this.predicted(first))} faces after ${first} level, ${refusal} of this service`;
  }

  private write(): void {
    const { settings } = this;
    select("levels").replaceChildren(
      ...this.levels().map((level) => {
        const faces = this.faces ? ` · ${count(this.predicted(level))} faces` : "";
        return option(String(level), `${level}${faces}`, this.refusal(level) !== "");
      }),
    );
    select("levels").value = String(settings.levels);
    const closed = this.levels().find((level) => this.refusal(level));
    element("levels-note").textContent = closed
      ? `${closed} and more: ${this.refusal(closed)} of this service`
      : "";
    const bundled = this.models.map((model) =>
      option(model.default ? "" : model.name, model.name + (model.default ? " (default)" : "")),
    );
    if (!bundled.length) bundled.push(option("", "default"));
    select("model").replaceChildren(...bundled, option(LOOP, "Loop’s rules alone"));
    select("model").value = settings.model;
    const unknown = select("model").value !== settings.model;
    // A model that a link names may be on a list that is still on its way.
    if (unknown && this.models.length) select("model").value = settings.model = this.wanted.model = "";
    input("budget").value = settings.budget === null ? "" : String(settings.budget);
    input("limit").checked = settings.limit;
    select("crease").value = settings.crease;
    input("angle").value = String(settings.angle);
    select("uv").value = settings.uv;
    select("normals").value = settings.normals;
    this.adjust();
  }

  private read(): void {
    const before = this.settings;
    const budget = input("budget");
    const angle = input("angle");
    // Where a number cannot be, that before it holds: other settings may change.
    const settings: Settings = {
      levels: Number(select("levels").value),
      model: select("model").value,
      budget: !budget.validity.valid ? before.budget : budget.value === "" ? null : Number(budget.value),
      limit: input("limit").checked,
      crease: select("crease").value as Settings["crease"],
      angle: angle.validity.valid ? Number(angle.value || DEFAULTS.angle) : before.angle,
      uv: select("uv").value as Settings["uv"],
      normals: select("normals").value as Settings["normals"],
    };
    if (settings.normals === "limit" && !settings.limit) {
      settings.limit = input("limit").checked = true;
    }
    const isNew = ([name, value]: [string, unknown]) => value !== before[name as keyof Settings];
    Object.assign(this.wanted, Object.fromEntries(Object.entries(settings).filter(isNew)));
    this.settings = settings;
    this.adjust();
    this.changed();
  }

  private adjust(): void {
    const { settings } = this;
    const model = this.models.find((entry) =>
      settings.model ? entry.name === settings.model : entry.default,
    );
    input("budget").placeholder = model ? `${model.budget}, the model’s` : "the model’s";
    input("budget").disabled = settings.model === LOOP;
    element("angle-row").hidden = settings.crease !== "angle";
  }
}
