/** Debian's Chromium, drawing in software, and a page that keeps account of what it did. */

import { existsSync } from "node:fs";
import { gunzipSync } from "node:zlib";
import { chromium } from "playwright-core";

export const CHROMIUM = process.env.CHROMIUM ?? "/usr/bin/chromium";
/** For node's `skip`: false, or why there is nothing to test with. */
export const noBrowser = existsSync(CHROMIUM) ? false : `needs ${CHROMIUM}`;

const DRAWN = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];

export function launch(...more) {
  return chromium.launch({
    executablePath: CHROMIUM,
    args: ["--no-sandbox", ...(more.length ? more : DRAWN)],
  });
}

/**
 * Open a page. `faults` collects foreign requests, violations of the policy, and errors on the console
 * except those of a status or of words that a test foresees. With `card` the page takes the renderer for
 * a graphics card, and draws as it does there. Without `live` the browser asks to save data: the page
 * then shows no example of its own accord.
 */
export async function open(browser, address, options = {}) {
  const { expected = [], foreseen, card, live, ...settings } = options;
  const context = await browser.newContext({ viewport: { width: 1000, height: 700 }, ...settings });
  const page = await context.newPage();
  // A page that hangs ends some time; a machine that is busy is no fault.
  page.setDefaultTimeout(Number(process.env.PATIENCE_MS ?? 600_000));
  const faults = [];
  const origin = new URL(address).origin;
  page.on("request", (request) => {
    const url = request.url();
    if (!url.startsWith(origin) && !url.startsWith("blob:")) faults.push(`foreign request: ${url}`);
  });
  page.on("pageerror", (error) => faults.push(`page error: ${error.stack}`));
  page.on("console", (message) => {
    const text = message.text();
    if (!["error", "warning"].includes(message.type())) return;
    if (foreseen?.test(text)) return;
    if (expected.some((status) => text.includes(`status of ${status}`))) return;
    // What the driver of a software renderer says of its speed is none of the page's.
    if (/GPU stall due to ReadPixels|GL Driver Message/.test(text)) return;
    faults.push(`${message.type()}: ${text}`);
  });
  await context.addInitScript(() => {
    addEventListener("securitypolicyviolation", (event) =>
      console.error(`policy: ${event.violatedDirective} ${event.blockedURI}`),
    );
  });
  if (!live) await context.addInitScript(() => Object.defineProperty(navigator, "connection", { value: { saveData: true } }));
  if (card) await context.addInitScript(nameRenderer, "A card");
  await page.goto(address);
  return { page, context, faults };
}

/** In the page: give what draws another name. */
function nameRenderer(name) {
  const { prototype } = WebGL2RenderingContext;
  const { getParameter } = prototype;
  const asked = new Set([prototype.RENDERER, 0x9246]); // UNMASKED_RENDERER_WEBGL
  prototype.getParameter = function (parameter) {
    return asked.has(parameter) ? name : getParameter.call(this, parameter);
  };
}

/** Hand files to the page as its file chooser would. */
export async function choose(page, ...files) {
  await page.setInputFiles("#files", files);
}

/** Wait for the result and Loop's side, and for whatever else the page then does. */
export async function settled(page) {
  await page.locator("body.refined").waitFor();
  await page.locator("#work").waitFor({ state: "hidden" });
  await page.waitForFunction(() => !/Looking/.test(document.querySelector("#validation-text").textContent));
}

/** Let jobs wait whose body and address are `held`; returns what releases them. */
export async function hold(page, held = () => true) {
  let release;
  const released = new Promise((resolve) => (release = resolve));
  await page.route(/\/subdivide\?/, async (route) => {
    const request = route.request();
    if (held(bodyOf(request), request.url())) await released;
    // The page may have ended it meanwhile.
    await route.continue().catch(() => {});
  });
  return release;
}

/** The body of a request as it was before compression; null where it has none. */
export function bodyOf(request) {
  const body = request.postDataBuffer();
  return body && request.headers()["content-encoding"] === "gzip" ? gunzipSync(body) : body;
}

/** What the page offers when a button is pressed, as bytes. */
export async function downloaded(page, button) {
  const [download] = await Promise.all([page.waitForEvent("download"), page.click(button)]);
  const pieces = [];
  for await (const piece of await download.createReadStream()) pieces.push(piece);
  return { name: download.suggestedFilename(), bytes: Buffer.concat(pieces) };
}

/** Unfold the options of downloads. */
export async function openDownloadOptions(page) {
  await page.$eval("#writing", (part) => (part.open = true));
}

/** The view as rows of RGBA, taken as the page's own picture. */
export async function picture(page) {
  await openDownloadOptions(page);
  const { bytes } = await downloaded(page, "#download-picture");
  const { width, height, data } = await page.evaluate(async (base64) => {
    const png = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([png]));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext("2d");
    context.drawImage(bitmap, 0, 0);
    const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
    let text = "";
    for (let i = 0; i < data.length; i += 8192) {
      text += String.fromCharCode(...data.subarray(i, i + 8192));
    }
    return { width: bitmap.width, height: bitmap.height, data: btoa(text) };
  }, bytes.toString("base64"));
  return { width, height, data: Buffer.from(data, "base64") };
}

/** The columns `from` to `to` of a picture, as bytes. */
export function columns({ width, height, data }, from, to) {
  const rows = [];
  for (let y = 0; y < height; y++) {
    rows.push(data.subarray(4 * (y * width + from), 4 * (y * width + to)));
  }
  return Buffer.concat(rows);
}
