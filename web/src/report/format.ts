/** Write numbers as people read them. */

const METRIC: [number, string][] = [
  [1e3, "km"],
  [1, "m"],
  [1e-2, "cm"],
  [1e-3, "mm"],
  [1e-6, "µm"],
  [1e-9, "nm"],
];

/** Degrees: where faces turn by less, positions in float32 may not tell it from nothing. */
export const FLAT = 0.01;

export type Unit = "metre" | "unit";

export function count(value: number): string {
  return value.toLocaleString("en-US");
}

/** Write a number of things. */
export function counted(value: number, thing: string): string {
  return `${count(value)} ${thing}${value === 1 ? "" : "s"}`;
}

/** Join a number and its unit so that no line break parts them. */
function measure(value: number | string, unit: string): string {
  return `${value}\u00a0${unit}`;
}

/** Round to two or three significant digits. */
export function figure(value: number): string {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return value.toExponential(1).replace("e+", "e");
  return String(Number(value.toPrecision(size >= 100 ? 3 : 2)));
}

/** Write a length: glTF counts in metres, other formats in an unnamed unit. */
export function length(value: number, unit: Unit): string {
  if (unit === "unit") return measure(figure(value), "units");
  if (value === 0) return measure(0, "m");
  const [scale, name] = METRIC.find(([scale]) => Math.abs(value) >= scale) ?? [1e-9, "nm"];
  return measure(figure(value / scale), name);
}

export function percent(share: number): string {
  if (share === 0) return measure(0, "%");
  const value = 100 * share;
  return measure(value < 0.01 ? "<\u00a00.01" : figure(value), "%");
}

/** Write an angle in degrees. */
export function angle(degrees: number): string {
  return degrees > 0 && degrees < FLAT ? `<\u00a0${FLAT}°` : `${figure(degrees)}°`;
}

export function bytes(value: number): string {
  if (value < 1000) return measure(value, "B");
  return value < 1e6 ? measure(figure(value / 1e3), "kB") : measure(figure(value / 1e6), "MB");
}

export function seconds(value: number): string {
  return value < 1 ? measure(Math.round(1000 * value), "ms") : measure(figure(value), "s");
}

/** List some names, and how many more there are. */
export function listed(names: string[], most = 3): string {
  const more = names.length - most;
  // One more takes no more room than the word of it.
  if (more <= 1) return names.join(", ");
  return `${names.slice(0, most).join(", ")} and ${more} more`;
}
