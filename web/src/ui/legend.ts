/** The legend of a heat map. */

import { cividis } from "../measure/cividis";
import type { Legend } from "../view/heat";
import { element } from "./dom";

export function showLegend(legend: Legend | null): void {
  const figure = element("legend");
  figure.hidden = !legend;
  if (!legend) return;
  figure.dataset.end = String(legend.end);
  figure.dataset.max = String(legend.max);
  element("legend-title").textContent = legend.title;
  element("legend-low").textContent = legend.low;
  element("legend-high").textContent = legend.high;
  element("legend-note").textContent = legend.note;
}

export function drawLegendBar(): void {
  const bar = element<HTMLCanvasElement>("legend-bar").getContext("2d");
  if (!bar) return;
  for (let x = 0; x < 256; x++) {
    bar.fillStyle = `rgb(${cividis(x / 255).join(" ")})`;
    bar.fillRect(x, 0, 1, 1);
  }
}
