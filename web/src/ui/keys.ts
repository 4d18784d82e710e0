/** What keys do while the canvas has the focus. */

import type { Viewer } from "../view/viewer";
import { element } from "./dom";
import type { Timeline } from "./timeline";

export function bindKeys(viewer: Viewer | null, timeline: Timeline, setWipe: (share: number) => void): void {
  const turn = Math.PI / 24;
  const click = (id: string) => () => element(id).click();
  const layout = (value: string) => () =>
    document.querySelector<HTMLInputElement>(`input[name="layout"][value="${value}"]`)?.click();
  const keys: Record<string, () => void> = {
    ArrowLeft: () => viewer?.rig.orbit(-turn, 0),
    ArrowRight: () => viewer?.rig.orbit(turn, 0),
    ArrowUp: () => viewer?.rig.orbit(0, -turn),
    ArrowDown: () => viewer?.rig.orbit(0, turn),
    "+": () => viewer?.rig.zoom(0.9),
    "=": () => viewer?.rig.zoom(0.9),
    "-": () => viewer?.rig.zoom(1 / 0.9),
    f: click("frame"),
    w: click("edges"),
    n: click("normal-lines"),
    "1": layout("wipe"),
    "2": layout("side"),
    "3": layout("overlay"),
    "4": layout("single"),
    ",": () => setWipe((viewer?.wipe ?? 0.5) - 0.05),
    ".": () => setWipe((viewer?.wipe ?? 0.5) + 0.05),
    " ": () => timeline.toggle(),
  };
  // Letters act only while the canvas has the focus: elsewhere they are typed.
  element("canvas").addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });
}
