/** What the validator says of the result that it did not say of the input. */

import type { Message, Outcome } from "gltf-validator";
import { counted } from "../report/format";

export interface Finding {
  code: string;
  message: string;
  pointer: string;
  /** 0 error, 1 warning, 2 information, 3 hint. */
  severity: number;
  times: number;
  isNew: boolean;
}

export interface Comparison {
  before: string;
  after: string;
  findings: Finding[];
}

/** By code: refinement moves pointers and numbers, and may repeat what a file always had. */
export function compare(input: Outcome | null, result: Outcome): Comparison {
  const known = new Set(input?.issues.messages.map(({ code }) => code));
  const byCode = new Map<string, Message[]>();
  for (const message of result.issues.messages) {
    byCode.set(message.code, [...(byCode.get(message.code) ?? []), message]);
  }
  const findings = [...byCode.values()].map((messages): Finding => {
    const first = messages[0]!;
    return {
      code: first.code,
      message: first.message,
      pointer: first.pointer ?? "",
      severity: first.severity,
      times: messages.length,
      isNew: !known.has(first.code),
    };
  });
  findings.sort((a, b) => Number(b.isNew) - Number(a.isNew) || a.severity - b.severity);
  return { before: input ? words(input) : "no glTF", after: words(result), findings };
}

function words({ issues }: Outcome): string {
  const { numErrors, numWarnings, numInfos, numHints } = issues;
  const parts = [
    named(numErrors, "error"),
    named(numWarnings, "warning"),
    named(numInfos + numHints, "remark"),
  ].filter(Boolean);
  return parts.join(", ") || "no findings";
}

function named(number: number, name: string): string {
  return number ? counted(number, name) : "";
}
