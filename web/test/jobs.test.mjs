/** What the user asks for while something is under way. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import { choose, downloaded, hold, noBrowser, settled } from "./support/browser.mjs";
import { broken, positions } from "./support/glb.mjs";
import { example, number, part, PART_FACES, studio, TETRAHEDRON } from "./support/studio.mjs";

describe("jobs of the page", { skip: noBrowser, timeout: 900_000 }, () => {
  const { visit } = studio();

  test("Loop’s side comes although a heat map asks for more", async () => {
    const page = await visit({ hash: "#levels=1&look=ratio" });
    await choose(page, example);
    await settled(page);
    await page.locator("#legend", { hasText: "Share of the budget" }).waitFor();
    await page.selectOption("#look", "distance");
    await page.locator("#legend", { hasText: "Distance to Loop" }).waitFor({ timeout: 5000 });
    await page.selectOption("#pair", "loop");
    assert.match(await page.textContent("#label-left"), /^Loop/);
  });

  for (const [what, other, leave] of [
    ["cancelled", example, (page) => page.click("#cancel")],
    ["refused", { ...example, name: "nan.glb", buffer: broken(part) }, (page) => page.click("#problem-close")],
  ]) {
    test(`Loop’s side comes after all where a second file that ended it is ${what}`, async () => {
      const page = await visit({ hash: "#levels=1&look=distance", expected: [422] });
      const release = await hold(page, (body, url) => /scheme=loop/.test(url) || body?.equals(part));
      await choose(page, TETRAHEDRON);
      await page.locator("#work-text", { hasText: "Loop’s side" }).waitFor();
      await choose(page, other);
      if (other === example) await page.locator("#levels", { hasText: number(4 * PART_FACES) }).waitFor({ state: "attached" });
      await leave(page);
      release();
      await page.locator("#legend", { hasText: "Distance to Loop" }).waitFor({ timeout: 5000 });
      await settled(page);
      assert.equal(await page.textContent("#file-name"), "tetrahedron.obj");
    });
  }

  test("a first file is refined after all where a second one that ended it is cancelled", async () => {
    const page = await visit({ hash: "#levels=1" });
    const release = await hold(page);
    await choose(page, TETRAHEDRON);
    await page.locator("#label-left", { hasText: "4 faces" }).waitFor();
    await choose(page, example);
    await page.locator("#levels", { hasText: number(4 * PART_FACES) }).waitFor({ state: "attached" });
    await page.click("#cancel");
    release();
    await page.locator("#label-right", { hasText: "16 faces" }).waitFor({ timeout: 5000 });
    await settled(page);
    assert.equal(await page.textContent("#file-name"), "tetrahedron.obj");
    assert.match(await page.textContent("#notice-text"), /^part\.glb: cancelled/);
  });

  test("Loop’s side that is cancelled itself stays so", async () => {
    const page = await visit({ hash: "#levels=1&look=distance" });
    await hold(page, (_, url) => /scheme=loop/.test(url));
    await choose(page, TETRAHEDRON);
    await page.locator("#work-text", { hasText: "Loop’s side" }).waitFor();
    await page.click("#cancel");
    await page.waitForTimeout(500);
    assert.ok(await page.isHidden("#work"));
  });

  test("settings that change while a second file is on its way are for that file", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, TETRAHEDRON);
    await settled(page);
    const release = await hold(page);
    await choose(page, example);
    await page.locator("#levels", { hasText: number(4 * PART_FACES) }).waitFor({ state: "attached" });
    await page.selectOption("#levels", "2");
    // Two is what a page without a word about levels takes.
    await page.waitForFunction(() => !location.hash.includes("levels"));
    release();
    await page.locator("#file-name", { hasText: "part.glb" }).waitFor({ timeout: 20_000 });
    await settled(page);
    assert.match(await page.textContent("#label-right"), new RegExp(`· ${number(16 * PART_FACES)} faces`));
  });

  test("a download of what is shown leaves the second file on its way", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, TETRAHEDRON);
    await settled(page);
    const release = await hold(page, (body) => body?.equals(part));
    await choose(page, example);
    await page.locator("#levels", { hasText: number(4 * PART_FACES) }).waitFor({ state: "attached" });
    await page.check("#attributes");
    const { name, bytes } = await downloaded(page, "#download");
    assert.equal(name, "tetrahedron-refined.glb");
    assert.ok(positions(bytes)[0].length < 3 * PART_FACES);
    release();
    await page.locator("#file-name", { hasText: "part.glb" }).waitFor({ timeout: 20_000 });
    await settled(page);
  });

  test("a first file that is cancelled is refined after all, without a mouse", async () => {
    const page = await visit({ hash: "#levels=1" });
    const release = await hold(page);
    await choose(page, example);
    await page.locator("#label-left", { hasText: number(PART_FACES) }).waitFor();
    await page.locator("#cancel").press("Enter");
    assert.equal(await page.textContent("#notice-text"), "part.glb: cancelled");
    release();
    await page.locator("#again:focus").press("Enter");
    await settled(page);
    assert.match(await page.textContent("#label-right"), new RegExp(`· ${number(4 * PART_FACES)} faces`));
    assert.ok(await page.isHidden("#notice"));
  });

  test("a second file that is cancelled is refined after all", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, TETRAHEDRON);
    await settled(page);
    const release = await hold(page);
    await choose(page, example);
    await page.locator("#levels", { hasText: number(4 * PART_FACES) }).waitFor({ state: "attached" });
    await page.click("#cancel");
    release();
    await page.click("#again");
    await page.locator("#file-name", { hasText: "part.glb" }).waitFor();
    await settled(page);
  });

  test("another try at a download that failed is that download", async () => {
    const page = await visit({ hash: "#levels=1", foreseen: /ERR_FAILED/ });
    await choose(page, example);
    await settled(page);
    await page.check("#attributes");
    await page.route(/\/jobs\?/, (route) => route.abort());
    await page.click("#download");
    await page.locator("#problem").waitFor();
    await page.unroute(/\/jobs\?/);
    const { name } = await downloaded(page, "#problem-again");
    assert.equal(name, "part-refined.glb");
  });

  test("a job that the service ends is told of, and one that it no longer knows: either can be tried again", async () => {
    const page = await visit({ hash: "#levels=5&model=signed", expected: [404] });
    const job = page.waitForResponse((answer) => answer.request().method() === "POST");
    await choose(page, example);
    const answer = await job;
    const { id } = await answer.json();
    // As a shutdown does, or another tab.
    await fetch(new URL(`/jobs/${id}`, answer.url()), { method: "DELETE" });
    await page.locator("#problem-title", { hasText: "The service ended the job" }).waitFor();
    assert.ok(await page.isVisible("#problem-again"));
    await page.route(/\/events$/, (route) =>
      route.fulfill({ status: 404, json: { title: "There is no such job", detail: "It is gone." } }),
    );
    await page.selectOption("#levels", "1");
    await page.locator("#problem-title", { hasText: "no such job" }).waitFor();
    await page.unroute(/\/events$/);
    await page.click("#problem-again");
    await settled(page);
  });

  test("a reader that did not come is told of, and comes once the page is loaded anew", async () => {
    const page = await visit({ hash: "#levels=1", foreseen: /ERR_FAILED/ });
    await page.route(/assets\/part-/, (route) => route.abort());
    await choose(page, TETRAHEDRON);
    await page.locator("#problem-title", { hasText: "A part of the page did not come" }).waitFor();
    assert.match(await page.textContent("#problem-detail"), /reload the page/);
    await page.unroute(/assets\/part-/);
    await page.reload();
    await choose(page, TETRAHEDRON);
    await settled(page);
  });

  test("a download that is cancelled is no refinement to ask for again", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, example);
    await settled(page);
    await hold(page);
    await page.check("#attributes");
    await page.click("#download");
    await page.click("#cancel");
    assert.ok(await page.isHidden("#work"));
    assert.ok(await page.isHidden("#notice"));
  });

  test("a second file that is cancelled leaves the form to the first", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, TETRAHEDRON);
    await settled(page);
    const form = () => page.$eval("#settings", (form) => [form.levels.textContent, form.normals.value]);
    const first = await form();
    await hold(page);
    await choose(page, example);
    await page.locator("#levels", { hasText: number(4 * PART_FACES) }).waitFor({ state: "attached" });
    await page.click("#cancel");
    await page.locator("#levels", { hasText: number(16) }).waitFor({ state: "attached", timeout: 5000 });
    assert.deepEqual(await form(), first);
    assert.equal(await page.textContent("#file-name"), "tetrahedron.obj");
  });
});
