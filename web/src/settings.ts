/** What the user may set, its place in the page's address, and the query that it becomes. */

export interface Settings {
  levels: number;
  /** A model's name; "" for the service's default; "loop" for the scheme without one. */
  model: string;
  /** C, dimensionless; null: the model's own. */
  budget: number | null;
  limit: boolean;
  crease: "auto" | "off" | "lines" | "normals" | "angle";
  /** Degrees. */
  angle: number;
  uv: "linear" | "smooth";
  normals: "keep" | "smooth" | "limit";
}

/** What a file is refined with, and what the user wants of any: a file may close levels, or have no normals to keep. */
export interface Asked {
  settings: Settings;
  wanted: Settings;
}

export const LOOP = "loop";

export const DEFAULTS: Settings = {
  levels: 2,
  model: "",
  budget: null,
  limit: false,
  crease: "auto",
  angle: 40,
  uv: "linear",
  normals: "keep",
};

export type Diagnostics = "summary" | "full";
export type Compression = "none" | "meshopt" | "draco";

/** The parameters of a job. */
export function query(
  settings: Settings,
  diagnostics: Diagnostics = "summary",
  compress: Compression = "none",
): URLSearchParams {
  const loop = settings.model === LOOP;
  const parameters = new URLSearchParams({
    levels: String(settings.levels),
    scheme: loop ? "loop" : "pns",
    diagnostics,
    uv: settings.uv,
    crease: settings.crease === "angle" ? `angle:${settings.angle}` : settings.crease,
  });
  if (!loop && settings.model) parameters.set("model", settings.model);
  if (!loop && settings.budget !== null) parameters.set("budget", String(settings.budget));
  if (settings.limit) parameters.set("limit", "true");
  if (settings.normals !== "keep") parameters.set("normals", settings.normals);
  if (compress !== "none") parameters.set("compress", compress);
  return parameters;
}

/** The same job by Loop's rules alone: the other side of the comparison. */
export function asLoop({ settings, wanted }: Asked): Asked {
  return { settings: { ...settings, model: LOOP, budget: null }, wanted };
}

/** The settings that differ from the defaults, as the part of an address after #. */
export function toHash(settings: Settings, view: Record<string, string>): string {
  const given = new URLSearchParams(view);
  for (const [name, value] of Object.entries(settings)) {
    if (value !== DEFAULTS[name as keyof Settings]) given.set(name, String(value));
  }
  return given.toString();
}

/** Settings from the part after #; what is not understood stays at its default. */
export function fromHash(hash: string): { settings: Settings; view: Record<string, string> } {
  const given = Object.fromEntries(new URLSearchParams(hash.replace(/^#/, "")));
  const settings = { ...DEFAULTS };
  const { levels, model, budget, limit, crease, angle, uv, normals, ...view } = given;
  settings.levels = whole(levels, 1, 6) ?? settings.levels;
  settings.model = model ?? settings.model;
  settings.budget = number(budget, 0, Infinity);
  // Normals of the limit surface stand there.
  settings.limit = limit === "true" || normals === "limit";
  settings.crease = oneOf(crease, ["auto", "off", "lines", "normals", "angle"]) ?? settings.crease;
  settings.angle = number(angle, 0, 180) ?? settings.angle;
  settings.uv = oneOf(uv, ["linear", "smooth"]) ?? settings.uv;
  settings.normals = oneOf(normals, ["keep", "smooth", "limit"]) ?? settings.normals;
  return { settings, view };
}

function number(text: string | undefined, least: number, most: number): number | null {
  const value = text ? Number(text) : NaN;
  return Number.isFinite(value) && value >= least && value <= most ? value : null;
}

function whole(text: string | undefined, least: number, most: number): number | null {
  const value = number(text, least, most);
  return value !== null && Number.isInteger(value) ? value : null;
}

function oneOf<T extends string>(text: string | undefined, choices: readonly T[]): T | null {
  return choices.find((choice) => choice === text) ?? null;
}
