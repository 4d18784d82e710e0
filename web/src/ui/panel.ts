/** Buttons of the header and the panel. */

import type { Again } from "../tasks";
import { announce, bindNotice, bindProblem } from "./status";
import { element } from "./dom";

export interface Actions {
  cancel(): void;
  reset(): void;
  /** Try again what failed last. */
  retry: Again;
  /** Refine after all what was cancelled. */
  resume: Again;
  showExample(): void;
  /** Put the settings into the address. */
  remember(): void;
}

export function bindPanel(actions: Actions): void {
  element("cancel").addEventListener("click", actions.cancel);
  element("reset").addEventListener("click", actions.reset);
  element("example").addEventListener("click", actions.showExample);
  bindNotice(() => actions.resume());
  bindProblem(() => actions.retry());
  document.querySelector(".skip")?.addEventListener("click", (event) => {
    // The part after # holds the settings.
    event.preventDefault();
    element("panel").focus();
  });
  element("fold").addEventListener("click", () => {
    const folded = document.body.classList.toggle("folded");
    element("fold").setAttribute("aria-expanded", String(!folded));
    element("fold").textContent = folded ? "Show settings" : "Hide settings";
  });
  element("share").addEventListener("click", () => void share(actions));
}

async function share(actions: Actions): Promise<void> {
  actions.remember();
  // Browsers keep the clipboard from pages without TLS; the address bar has the link all the same.
  const copied = await navigator.clipboard?.writeText(location.href).then(
    () => true,
    () => false,
  );
  announce(copied ? "The link is copied" : "The link is in the address bar");
  element("share").textContent = copied ? "Copied" : "See address bar";
  setTimeout(() => (element("share").textContent = "Copy link"), 1500);
}

/**
 * Keep the focus where a control that has it goes away: on what takes its place, the canvas for what
 * stood over it, the panel for the rest. A keyboard user would begin at the top of the page again.
 */
export function keepFocus(): void {
  let last: HTMLElement | null = null;
  document.addEventListener("focusin", ({ target }) => (last = target as HTMLElement));
  const look = (): void => {
    if (!last || isSeen(last)) return;
    const isLost = document.activeElement === document.body || document.activeElement === last;
    const canvas = element("canvas");
    const next = last.closest(".stage") && isSeen(canvas) ? canvas : element("panel");
    last = null;
    if (isLost) next.focus({ preventScroll: true });
  };
  new MutationObserver(look).observe(document.body, {
    subtree: true,
    attributes: true,
    attributeFilter: ["hidden", "class", "disabled"],
  });
}

function isSeen(shown: HTMLElement): boolean {
  return shown.getClientRects().length > 0;
}
