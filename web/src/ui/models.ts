/** The bundled models, each in a sentence. */

import { LOOP } from "../settings";

const SENTENCES: Record<string, string> = {
  general: "Recommended. For scans, parts and characters of any size.",
  "general-quad": "As general, for meshes of four-sided faces.",
  signed: "The published method with better features, trained on ridges. For comparison.",
  paper: "The published method to the letter, trained on ridges. For comparison.",
  [LOOP]: "The classic formula: nothing is learned. For cages drawn for it.",
};

export function describeModel(name: string): string {
  return SENTENCES[name] ?? "";
}
