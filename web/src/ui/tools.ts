/** The tools under the picture, as the page's address holds them. */

import type { Layout } from "../view/viewer";
import { input, select } from "./dom";
import { LINES } from "./overlays";

const CHOICES = ["pair", "look"] as const;

export function chosenLayout(): Layout {
  const chosen = document.querySelector<HTMLInputElement>('input[name="layout"]:checked');
  return (chosen?.value ?? "wipe") as Layout;
}

/** Return what differs from the first view. */
export function chosenView(): Record<string, string> {
  const view: Record<string, string> = {};
  if (chosenLayout() !== "wipe") view.layout = chosenLayout();
  for (const name of CHOICES) if (select(name).selectedIndex > 0) view[name] = select(name).value;
  for (const lines of LINES) if (input(lines).checked) view[lines] = "1";
  return view;
}

/** Choose a view; a value that is not understood stays at its default. */
export function chooseView(view: Record<string, string>): void {
  const layout = `input[name="layout"][value="${CSS.escape(view.layout ?? "wipe")}"]`;
  const radio = document.querySelector<HTMLInputElement>(layout);
  if (radio) radio.checked = true;
  for (const name of CHOICES) {
    select(name).value = view[name] ?? "";
    if (select(name).selectedIndex < 0) select(name).selectedIndex = 0;
  }
  for (const lines of LINES) input(lines).checked = view[lines] === "1";
}
