/** The page for all eyes, hands and screens. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import axe from "axe-core";
import { choose, noBrowser, openDownloadOptions, settled } from "./support/browser.mjs";
import { moving } from "./support/glb.mjs";
import { example, part, studio } from "./support/studio.mjs";

describe("access", { skip: noBrowser, timeout: 1_800_000 }, () => {
  const { visit } = studio();

  for (const colorScheme of ["light", "dark"]) {
    test(`axe finds no fault (${colorScheme})`, async () => {
      const page = await visit({ colorScheme, hash: "#levels=1" });
      assert.deepEqual(await faultsOf(page), []);
      // It leaves out how one choice is told from the others.
      const chosen = [".segments input:checked + span", "backgroundColor"];
      assert.ok((await contrast(page, chosen, [".segments", "backgroundColor"])) >= 3);
      await choose(page, { ...example, buffer: moving(part, 1) });
      await settled(page);
      await unfold(page);
      await page.selectOption("#look", "distance");
      assert.deepEqual(await faultsOf(page), []);
      await choose(page, { name: "a.txt", mimeType: "", buffer: Buffer.from("") });
      await page.locator("#problem").waitFor();
      assert.deepEqual(await faultsOf(page), []);
    });
  }

  for (const [width, lines] of [[1440, 1], [1024, 1], [800, 2], [390, 2]]) {
    test(`tools take ${lines} lines at ${width} pixels, and none stands alone`, async () => {
      const page = await visit({ viewport: { width, height: 700 }, hash: "#levels=1" });
      await choose(page, example);
      await settled(page);
      const middles = await page.$$eval("#tools :is(#layout, select, .toggle, button)", (tools) =>
        tools.map((tool) => tool.getBoundingClientRect()).map(({ top, height }) => Math.round((top + height / 2) / 12)),
      );
      const counts = [...new Set(middles)].map((line) => middles.filter((other) => other === line).length);
      assert.deepEqual(counts, lines === 1 ? [6] : [1, 5]);
      const [tools, view] = await Promise.all(["#tools", ".stage"].map((id) => page.locator(id).boundingBox()));
      assert.ok(tools.x >= view.x && tools.x + tools.width <= view.x + view.width);
    });
  }

  test("with forced colours a switch is seen, whether it is on, and where the wipe stands", async () => {
    const page = await visit({ forcedColors: "active", hash: "#levels=1" });
    const lit = async (clip) => {
      const shot = (await page.screenshot({ clip })).toString("base64");
      return page.evaluate(async (png) => {
        const bytes = Uint8Array.from(atob(png), (character) => character.charCodeAt(0));
        const bitmap = await createImageBitmap(new Blob([bytes]));
        const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext("2d");
        context.drawImage(bitmap, 0, 0);
        const row = context.getImageData(0, bitmap.height >> 1, bitmap.width, 1).data;
        // Of one row of pixels each colour once.
        return [...new Set(new Uint32Array(row.buffer))].length;
      }, shot);
    };
    await page.click(".more summary");
    const limit = await page.locator("#limit").boundingBox();
    assert.ok((await lit(limit)) > 1);
    await page.uncheck("#limit");
    assert.ok((await lit(limit)) > 1);
    await choose(page, example);
    await settled(page);
    // Above the model nothing else is drawn.
    const wipe = await page.locator("#wipe").boundingBox();
    assert.ok((await lit({ ...wipe, height: 20 })) > 1);
  });

  test("nothing overflows a phone of 360 pixels", async () => {
    const page = await visit({ viewport: { width: 360, height: 640 }, hasTouch: true, hash: "#levels=1" });
    const width = () => page.evaluate(() => document.scrollingElement.scrollWidth);
    assert.equal(await width(), 360);
    await choose(page, { ...example, name: `${"long ".repeat(20)}.glb`, buffer: moving(part, 1) });
    await settled(page);
    await unfold(page);
    await page.selectOption("#look", "distance");
    assert.equal(await width(), 360);
    const outside = await page.evaluate(() =>
      [...document.querySelectorAll("button, select, input, label, summary")]
        .filter((element) => element.checkVisibility() && !element.closest(".hidden"))
        .map((element) => [element.id || element.textContent, element.getBoundingClientRect()])
        .filter(([, box]) => box.width && (box.left < 0 || box.right > 360))
        .map(([name]) => name),
    );
    assert.deepEqual(outside, []);
  });

  test("on a phone nothing that is told or has the focus lies under the canvas", async () => {
    const page = await visit({ viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true, hash: "#levels=1", foreseen: /ERR_FAILED/ });
    await choose(page, example);
    await settled(page);
    await openDownloadOptions(page);
    await page.check("#attributes");
    await page.route(/\/subdivide\?/, (route) => route.abort());
    await page.click("#download");
    await page.locator("#problem").waitFor();
    const covered = () => page.evaluate(() => {
      const { bottom } = document.querySelector(".stage").getBoundingClientRect();
      const here = document.querySelector("#problem:not([hidden])") ?? document.activeElement;
      const { top } = here.getBoundingClientRect();
      return !here.closest(".stage, .bar") && here !== document.body && top < bottom ? here.id || here.textContent : null;
    });
    assert.equal(await covered(), null);
    await page.click("#problem-close");
    await unfold(page);
    await page.focus("#download-picture");
    // Backwards, past every control of the panel.
    for (let i = 0; i < 30; i++) {
      await page.keyboard.press("Shift+Tab");
      assert.equal(await covered(), null);
    }
  });
});

async function unfold(page) {
  await page.evaluate(() => document.querySelectorAll("details").forEach((part) => (part.open = true)));
}

async function faultsOf(page) {
  // Evaluated by the driver: the page's policy lets no script of ours in.
  const { violations } = await page.evaluate(`${axe.source}; axe.run({ resultTypes: ["violations"] })`);
  return violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 120)).join(" | ")}`);
}

/** WCAG's contrast of two colours: each a selector, a property, and what pseudo-element has it. */
function contrast(page, ...colours) {
  return page.evaluate((colours) => {
    const luminance = ([selector, property, pseudo]) => {
      const colour = getComputedStyle(document.querySelector(selector), pseudo)[property];
      const [r, g, b] = colour.match(/\d+/g).map((part) => part / 255).map((x) => (x <= 0.03928 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4));
      return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const [one, other] = colours.map(luminance);
    return (Math.max(one, other) + 0.05) / (Math.min(one, other) + 0.05);
  }, colours);
}
