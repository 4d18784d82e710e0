/** What the user may set, its place in the page's address, and the query that it becomes. */

export interface Settings {
  levels: number;
  /** The most faces, of which there are more where the surface bends; null: all are split, so often as `levels` says. */
  faces: number | null;
  /** A model's name; "" for the service's default; "loop" for the classic rule; "scheme:NAME" for another base scheme. */
  model: string;
  /** C, dimensionless; null: the model's own. */
  budget: number | null;
  limit: boolean;
  crease: (typeof CHOICES.crease)[number];
  /** Degrees. */
  angle: number;
  uv: (typeof CHOICES.uv)[number];
  /** Join vertices that nearly coincide. */
  weld: boolean;
  /** Join a glTF's triangles that are one polygon, and refine quads. */
  polygons: boolean;
  normals: (typeof CHOICES.normals)[number];
}

/** Settings that are one of several words, and those that are on or off: the form has a field for each. */
export const CHOICES = {
  crease: ["auto", "angle", "normals", "off"],
  uv: ["linear", "smooth"],
  normals: ["auto", "keep", "smooth"],
} as const;
export const SWITCHES = ["limit", "weld", "polygons"] as const;

/** Settings for one file, and those that the user wants for any file: a large file may close levels. */
export interface Asked {
  settings: Settings;
  wanted: Settings;
}

/** The classic rule, whichever it is for a file. */
export const LOOP = "loop";

/** Before the name of a base scheme that is none of the classic ones. */
export const SCHEME = "scheme:";

/** The classic rules: of triangles, and of polygons. */
export type Classic = "loop" | "catmull-clark";

const NAMES: Record<string, string> = { loop: "Loop", "catmull-clark": "Catmull–Clark" };

export function isClassic(base: string): base is Classic {
  return base in NAMES;
}

/** A base scheme's name for readers. */
export function nameOf(base: string): string {
  return NAMES[base] ?? base;
}

/** Return the base scheme that is asked for in a model's place; null where a model is. */
function baseOf({ model }: Settings, classic: Classic): string | null {
  if (model === LOOP) return classic;
  return model.startsWith(SCHEME) ? model.slice(SCHEME.length) : null;
}

/** Whether a model is asked for. */
export function learns(settings: Settings): boolean {
  return baseOf(settings, "loop") === null;
}

/** How near vertices have to be to be joined, in units of R: the length that the service's advice names. */
const WELD = "0.001";

export const DEFAULTS: Settings = {
  levels: 2,
  faces: null,
  model: "",
  budget: null,
  limit: true,
  crease: "auto",
  angle: 60,
  uv: "linear",
  weld: false,
  polygons: false,
  normals: "auto",
};

export type Diagnostics = "summary" | "full";
export type Compression = "none" | "meshopt" | "draco";
export type Format = "glb" | "obj" | "ply" | "stl" | "off" | "3mf";

/** How an answer is to be written. */
export interface Writing {
  diagnostics?: Diagnostics;
  compress?: Compression;
  format?: Format;
}

/** Return the parameters of a job; `classic` is the file's classic rule. What is at the service's default is left out where it may be. */
export function query(settings: Settings, classic: Classic, writing: Writing = {}): URLSearchParams {
  const base = baseOf(settings, classic);
  const { diagnostics = "summary", compress = "none", format = "glb" } = writing;
  const parameters = new URLSearchParams({
    levels: String(settings.levels),
    scheme: base ?? (settings.model ? "pns" : "auto"),
    diagnostics,
    uv: settings.faces === null ? settings.uv : DEFAULTS.uv,
    crease: settings.crease === "angle" ? `angle:${settings.angle}` : settings.crease,
  });
  if (!base && settings.model) parameters.set("model", settings.model);
  if (!base && settings.budget !== null) parameters.set("budget", String(settings.budget));
  // Faces of several levels lie on the limit surface, and are triangles.
  if (settings.faces !== null) parameters.set("max_faces", String(settings.faces));
  if (!settings.limit && settings.faces === null) parameters.set("limit", "false");
  if (settings.weld) parameters.set("weld_tolerance", WELD);
  if (settings.polygons && settings.faces === null) parameters.set("polygons", "auto");
  if (settings.normals !== "auto") parameters.set("normals", settings.normals);
  if (compress !== "none") parameters.set("compress", compress);
  if (format !== "glb") parameters.set("format", format);
  return parameters;
}

/** Return the settings for the classic rule alone: the other side of the comparison. */
export function asLoop({ settings, wanted }: Asked): Asked {
  return { settings: { ...settings, model: LOOP, budget: null }, wanted };
}

/** Write the settings that differ from the defaults as the part of an address after #. */
export function toHash(settings: Settings, view: Record<string, string>): string {
  const given = new URLSearchParams(view);
  for (const [name, value] of Object.entries(settings)) {
    if (value !== DEFAULTS[name as keyof Settings]) given.set(name, String(value));
  }
  return given.toString();
}

/** Read settings from the part after #; a value that is not understood stays at its default. */
export function fromHash(hash: string): { settings: Settings; view: Record<string, string> } {
  const given = Object.fromEntries(new URLSearchParams(hash.replace(/^#/, "")));
  const settings = { ...DEFAULTS };
  const { levels, faces, model, budget, angle, ...others } = given;
  settings.levels = whole(levels, 1, 6) ?? settings.levels;
  settings.faces = whole(faces, 1, Infinity);
  settings.model = model ?? settings.model;
  settings.budget = number(budget, 0, Infinity);
  settings.angle = number(angle, 0, 180) ?? settings.angle;
  const words = Object.entries(CHOICES).map(([name, choices]) => [name, choices.find((choice) => choice === given[name])]);
  const flags = SWITCHES.map((name) => [name, ({ true: true, false: false } as Record<string, boolean>)[given[name] ?? ""]]);
  Object.assign(settings, Object.fromEntries([...words, ...flags].filter(([, value]) => value !== undefined)));
  const view = Object.fromEntries(Object.entries(others).filter(([name]) => !(name in DEFAULTS)));
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
