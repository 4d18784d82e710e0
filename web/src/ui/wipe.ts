/** The handle of the wipe: a slider for mouse, touch and keys. */

import { element } from "./dom";

export function bindWipe(moved: (share: number) => void): (share: number) => void {
  const handle = element("wipe");
  const stage = element("view");
  let share = 0.5;
  const set = (value: number): void => {
    share = Math.min(Math.max(value, 0), 1);
    handle.style.left = `${100 * share}%`;
    handle.setAttribute("aria-valuenow", String(Math.round(100 * share)));
    moved(share);
  };
  handle.addEventListener("pointerdown", (event) => {
    handle.setPointerCapture(event.pointerId);
    event.preventDefault();
    handle.focus({ preventScroll: true });
  });
  handle.addEventListener("pointermove", (event) => {
    if (!handle.hasPointerCapture(event.pointerId)) return;
    const box = stage.getBoundingClientRect();
    set((event.clientX - box.left) / box.width);
  });
  const keys: Record<string, () => number> = {
    ArrowLeft: () => share - 0.02,
    ArrowRight: () => share + 0.02,
    ArrowDown: () => share - 0.02,
    ArrowUp: () => share + 0.02,
    PageDown: () => share - 0.1,
    PageUp: () => share + 0.1,
    Home: () => 0,
    End: () => 1,
  };
  handle.addEventListener("keydown", (event) => {
    const step = keys[event.key];
    if (!step) return;
    event.preventDefault();
    set(step());
  });
  return set;
}
