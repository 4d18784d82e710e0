/** Where files come from: what is chosen, dropped on the page, or pasted. */

import { chosen, dropped } from "../files/dropped";
import type { PathedFile } from "../files/upload";
import { element, input } from "./dom";

export function bindFiles(take: (files: PathedFile[] | Promise<PathedFile[]>) => void): void {
  const files = input("files");
  for (const id of ["choose", "choose-first", "choose-own"]) {
    element(id).addEventListener("click", () => files.click());
  }
  files.addEventListener("change", () => {
    if (files.files?.length) take(chosen(files.files));
    // The same file may be chosen again.
    files.value = "";
  });
  const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
  document.addEventListener("dragover", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    document.body.classList.add("dragging");
  });
  document.addEventListener("dragleave", (event) => {
    if (!event.relatedTarget) document.body.classList.remove("dragging");
  });
  document.addEventListener("drop", (event) => {
    // Words may be dropped into a field.
    if (!event.dataTransfer || !hasFiles(event)) return;
    event.preventDefault();
    document.body.classList.remove("dragging");
    take(dropped(event.dataTransfer));
  });
  document.addEventListener("paste", (event) => {
    if (event.clipboardData?.files.length) take(chosen(event.clipboardData.files));
  });
}
