/**
 * How long from a drop to the picture, and how many frames a second: `node measure.mjs`. Prints
 * figures and judges none: they are the machine's.
 */

import { choose, launch, open, settled } from "./test/support/browser.mjs";
import { serve } from "./test/support/server.mjs";

const RUNS = 3;
const SECONDS = 4;
const VIEWPORT = { width: 1280, height: 800 };

const server = await serve();
await server.warm();
const browser = await launch();

for (const [across, levels] of [
  [50, 2],
  [47, 3],
]) {
  const source = { name: "torus.obj", mimeType: "", buffer: torus(50, across) };
  const name = `${(100 * across * 4 ** levels).toLocaleString("en-US")} triangles`;
  const drops = [];
  const frames = [];
  for (let run = 0; run < RUNS; run++) {
    const hash = `#levels=${levels}&layout=single&look=clay`;
    const { page, context } = await open(browser, `${server.address}/${hash}`, { viewport: VIEWPORT });
    await page.evaluate(() => {
      window.shown = new Promise((resolve) =>
        new MutationObserver(() => {
          // Drawn in the frame after the one that sets the class.
          if (document.body.classList.contains("refined")) {
            requestAnimationFrame(() => requestAnimationFrame(() => resolve(performance.now())));
          }
        }).observe(document.body, { attributes: true }),
      );
    });
    const began = await page.evaluate(() => performance.now());
    await choose(page, source);
    drops.push(((await page.evaluate(() => window.shown)) - began) / 1000);
    await settled(page);
    frames.push(await page.evaluate(turning, SECONDS));
    await context.close();
  }
  console.log(`${name}: drop to picture ${spread(drops)} s, ${spread(frames)} frames a second`);
}
await browser.close();
await server.close();

/** An OBJ of 2 × around × across triangles. */
function torus(around, across) {
  const lines = [];
  for (let i = 0; i < around; i++) {
    for (let j = 0; j < across; j++) {
      const [u, v] = [(2 * Math.PI * i) / around, (2 * Math.PI * j) / across];
      const radius = 1 + 0.4 * Math.cos(v);
      lines.push(`v ${radius * Math.cos(u)} ${0.4 * Math.sin(v)} ${radius * Math.sin(u)}`);
    }
  }
  const at = (i, j) => 1 + (i % around) * across + (j % across);
  for (let i = 0; i < around; i++) {
    for (let j = 0; j < across; j++) {
      lines.push(`f ${at(i, j)} ${at(i, j + 1)} ${at(i + 1, j + 1)}`);
      lines.push(`f ${at(i, j)} ${at(i + 1, j + 1)} ${at(i + 1, j)}`);
    }
  }
  return Buffer.from(lines.join("\n"));
}

/** In the page: drag the model around and count the frames that come. */
async function turning(seconds) {
  const canvas = document.querySelector("#canvas");
  const at = (type, x) =>
    canvas.dispatchEvent(
      new PointerEvent(type, { pointerId: 1, clientX: x, clientY: 300, button: 0, buttons: 1, bubbles: true }),
    );
  canvas.setPointerCapture = () => {};
  canvas.releasePointerCapture = () => {};
  const drawn = () => Number(canvas.dataset.frames);
  const first = drawn();
  const began = performance.now();
  at("pointerdown", 300);
  for (let x = 300; performance.now() - began < 1000 * seconds; x += 3) {
    at("pointermove", x);
    await new Promise(requestAnimationFrame);
  }
  at("pointerup", 300);
  return (drawn() - first) / ((performance.now() - began) / 1000);
}

function spread(values) {
  const sorted = [...values].sort((a, b) => a - b);
  const [low, middle, high] = [sorted[0], sorted[sorted.length >> 1], sorted.at(-1)];
  return `${middle.toFixed(1)} (${low.toFixed(1)} to ${high.toFixed(1)})`;
}
