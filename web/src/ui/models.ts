/** The bundled models, each in a sentence. */

import type { ModelEntry } from "../api/client";
import { LOOP, SCHEME } from "../settings";

const SENTENCES: Record<string, string> = {
  general: "Recommended: keeps what is sharp and does not shrink.",
  "general-quad": "As general, for meshes of four-sided faces.",
  signed: "The published method with better features, trained on ridges. For comparison.",
  paper: "The published method to the letter, trained on ridges. For comparison.",
  [LOOP]: "The classic formula: nothing is learned. For cages drawn for it.",
};

/** The page's name of a rule: those that nobody but researchers wants say so. */
export function ruleName({ name, default: isDefault }: ModelEntry): string {
  if (isDefault) return "Learned";
  return ["paper", "signed"].includes(name) ? `Research: ${name}` : name;
}

export function describeModel(name: string): string {
  return SENTENCES[name] ?? (name.startsWith(SCHEME) ? "A formula of this service: nothing is learned." : "");
}
