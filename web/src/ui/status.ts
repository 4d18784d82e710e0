/** Progress, notices and problems. */

import { useKey } from "../api/client";
import type { Progress } from "../api/jobs";
import { problemFrom } from "../api/problem";
import { percent } from "../report/format";
import { element, input } from "./dom";

const STAGES: Record<string, string> = {
  read: "Reading",
  weld: "Welding",
  refine: "Refining",
  attributes: "Normals and attributes",
  write: "Writing",
};

export function sentence(progress: Progress): string {
  return `${progress.again ? "The connection broke, trying once more: " : ""}${stepOf(progress)}`;
}

function stepOf({ step, share, place, stage }: Progress): string {
  const done = share === null ? "" : ` ${Math.round(100 * share)} %`;
  switch (step) {
    case "open":
      return "Opening the file";
    case "upload":
      return `Uploading${done}`;
    case "queue":
      return place ? `Waiting, number ${place} in line` : "Waiting for a worker";
    case "refine":
      return `${STAGES[stage ?? ""] ?? "Refining"}${done}`;
    case "download":
      return `Downloading${done}`;
  }
}

/** Show progress; `what` names a job beside the result that is shown, which else is out of date. */
export function showProgress(progress: Progress, what = ""): void {
  element("work").hidden = false;
  document.body.classList.toggle("stale", !what);
  const text = `${sentence(progress)}${what ? ` · ${what}` : ""}`;
  element("work-text").textContent = text;
  // A screen reader is to hear each step once, and no percents.
  const step = text.replace(/ \d+ %.*?(?= ·|$)/, "");
  if (element("announce").textContent !== step) announce(step);
  const bar = element<HTMLProgressElement>("work-bar");
  if (progress.share === null) bar.removeAttribute("value");
  else bar.value = progress.share;
  bar.setAttribute("aria-valuetext", percent(progress.share ?? 0));
}

export function hideProgress(): void {
  element("work").hidden = true;
  document.body.classList.remove("stale");
}

/** Show a notice; `again` offers the refinement that was cancelled. */
export function showNotice(text: string, again = false): void {
  element("notice-text").textContent = text;
  element("again").hidden = !again;
  element("notice").hidden = false;
  announce(text);
}

/** Add a sentence to the notice. */
export function addNotice(text: string): void {
  const shown = element("notice").hidden ? "" : element("notice-text").textContent;
  showNotice(`${shown} ${text}`.trim());
}

export function hideNotice(): void {
  element("notice").hidden = true;
}

/** Bind the notice's buttons; `again` refines after all. */
export function bindNotice(again: () => void): void {
  element("again").addEventListener("click", () => {
    hideNotice();
    again();
  });
  element("notice-close").addEventListener("click", hideNotice);
}

export function announce(text: string): void {
  element("announce").textContent = text;
}

/** Show a problem; `file` names the file at fault, since another may be shown. */
export function showProblem(error: unknown, file = ""): void {
  const problem = problemFrom(error);
  if (!problem) console.error(error);
  element("problem-title").textContent = problem?.title ?? "The page failed";
  element("problem-detail").textContent = asSentence(problem?.message ?? String(error));
  const pointer = problem?.pointer ?? problem?.parameter ?? "";
  const isNamed = !file || problem?.message.includes(file);
  const place = [isNamed ? "" : `in ${file}`, pointer && `at ${pointer}`].filter(Boolean).join(", ");
  element("problem-pointer").textContent = place;
  element("problem-pointer").hidden = !place;
  element("key-form").hidden = problem?.status !== 401;
  // The service is busy, slow or gone: the same may work in a moment.
  element("problem-again").hidden = !problem || (problem.status < 500 && ![0, 408, 429].includes(problem.status));
  element("problem").hidden = false;
  element("problem").scrollIntoView({ block: "nearest" });
  if (problem?.status === 401) input("key").focus();
}

function asSentence(text: string): string {
  // A file keeps its name.
  const first = /^\S+\.\w/.test(text) ? text.charAt(0) : text.charAt(0).toUpperCase();
  return `${first}${text.slice(1)}${/[.!?]$/.test(text) ? "" : "."}`;
}

export function hideProblem(): void {
  element("problem").hidden = true;
}

/** Bind the problem's buttons and its form of a key; `again` is another try. */
export function bindProblem(again: () => void): void {
  element("problem-again").addEventListener("click", () => {
    hideProblem();
    again();
  });
  element("problem-close").addEventListener("click", hideProblem);
  element("key-form").addEventListener("submit", (event) => {
    event.preventDefault();
    useKey(input("key").value);
    input("key").value = "";
    hideProblem();
    again();
  });
}
