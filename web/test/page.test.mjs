/** A file on the page, from its drop to its download. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import { choose, downloaded, launch, noBrowser, open, openDownloadOptions, settled } from "./support/browser.mjs";
import { bare, largestTurn, report } from "./support/glb.mjs";
import { serve } from "./support/server.mjs";
import { example, number, part, PART_FACES, same, studio } from "./support/studio.mjs";

describe("the page", { skip: noBrowser, timeout: 1_800_000 }, () => {
  const { visit, refined } = studio();

  test("a dropped file is refined, to the exact number of faces", async () => {
    const page = await visit();
    await drop(page, part, "part.glb");
    await settled(page);
    assert.match(await page.textContent("#label-right"), new RegExp(`· ${number(16 * PART_FACES)} faces`));
    assert.match(await page.textContent("#label-left"), new RegExp(`${number(PART_FACES)} faces`));
    const statements = await page.textContent("#promises");
    // At the end of a line a unit would stand without its number.
    assert.doesNotMatch(statements, /\d (c?m|%)/);
    assert.equal(await page.textContent("#validation-badge"), "nothing new");
    // Seams apart, as the service counts: 48 columns of 20 rows, closed.
    const rows = await page.$$eval("#statistics tbody tr", (rows) =>
      rows.map((row) => [...row.cells].map((cell) => cell.textContent)),
    );
    const [before, after] = [1, 2].map((side) => new Map(rows.map((row) => [row[0], row[side]])));
    assert.equal(before.get("Vertices of the surface"), "960");
    assert.equal(after.get("Vertices of the surface"), number(16 * 960));
    assert.equal(before.get("Boundary edges"), "0");
    const stages = await page.$$eval("#timings th", (names) => names.map(({ textContent }) => textContent));
    for (const stage of ["Upload", "Queue", "Service: reading", "Service: refining", "Service: writing", "Opening the result"]) {
      assert.ok(stages.includes(stage), `no ${stage} in ${stages}`);
    }
  });

  test("edges that are kept sharp are among the sharpest of a heat map", async () => {
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => `v ${i & 1} ${(i >> 1) & 1} ${i >> 2}`);
    const sides = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"].map((side) => `f ${side}`);
    const page = await visit({ hash: "#levels=1&look=dihedral" });
    await drop(page, Buffer.from([...corners, ...sides].join("\n")), "box.obj");
    await settled(page);
    // The model takes them for sharp all but a thousandth.
    const sharpest = Number(await page.getAttribute("#legend", "data-max"));
    assert.ok(sharpest > 85 && sharpest < 91, String(sharpest));
  });

  test("edges between materials are among the sharpest", async () => {
    const tetrahedron = bare();
    const { primitives } = tetrahedron.meshes[0];
    // The face that is slanted has a material of its own.
    tetrahedron.accessors[1].count = 9;
    tetrahedron.accessors.push({ ...tetrahedron.accessors[1], byteOffset: 18, count: 3 });
    tetrahedron.materials = [{}, {}];
    primitives.push({ ...primitives[0], indices: 2, material: 1 });
    const page = await visit({ hash: "#levels=1&look=dihedral&crease=off" });
    await drop(page, Buffer.from(JSON.stringify(tetrahedron)), "two.gltf");
    await settled(page);
    const turn = largestTurn((await downloaded(page, "#download")).bytes);
    const sharpest = Number(await page.getAttribute("#legend", "data-max"));
    assert.ok(Math.abs(sharpest - turn) < 1e-3, `${sharpest} is not ${turn}`);
  });

  test("of a sheet in a plane no turn is told, and what is said of planes holds for its bent boundary", async () => {
    // Thirds and sevenths: float32 rounds each place.
    const places = Array.from({ length: 25 }, (_, i) => [Math.floor(i / 5) + (i % 3) / 7, (i % 5) + (i % 2) / 3]);
    const squares = [0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13].map((i) => `f ${i + 1} ${i + 2} ${i + 7} ${i + 6}`);
    const lines = [...places.map(([x, y]) => `v ${x} ${y} ${0.7 * x - 0.3 * y}`), ...squares];
    const page = await visit({ hash: "#levels=1&look=dihedral" });
    await drop(page, Buffer.from(lines.join("\n")), "sheet.obj");
    await settled(page);
    assert.equal(await page.textContent("#legend-high"), "0°");
    assert.match(await page.textContent("#mathematics"), /boundaries and creases may bend within their plane/);
  });

  test("where streams cannot be iterated over, as in Safari, a file is refined all the same", async () => {
    const page = await visit();
    await page.addInitScript(() => {
      delete ReadableStream.prototype[Symbol.asyncIterator];
      delete ReadableStream.prototype.values;
    });
    await page.goto(`${page.url()}#levels=1`);
    await page.reload();
    await choose(page, example);
    await page.locator("body.refined, #problem:not([hidden])").first().waitFor();
    assert.equal(await page.textContent("#problem-title"), "");
    await settled(page);
    assert.equal(report((await downloaded(page, "#download")).bytes).totals.faces, 4 * PART_FACES);
  });

  test("what is downloaded is what the service answers, byte for byte", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, example);
    await settled(page);
    const plain = await downloaded(page, "#download");
    assert.equal(plain.name, "part-refined.glb");
    same(plain.bytes, await refined("levels=1"));
    await openDownloadOptions(page);
    await page.check("#attributes");
    await page.selectOption("#compress", "meshopt");
    const full = await downloaded(page, "#download");
    same(full.bytes, await refined("levels=1&diagnostics=full&compress=meshopt"));
    const text = await downloaded(page, "#download-report");
    assert.deepEqual(JSON.parse(text.bytes), report(plain.bytes));
  });

  test("upload after upload, the graphics card holds no more", async () => {
    const page = await visit({ hash: "#levels=1" });
    const held = async () => {
      await choose(page, example);
      await settled(page);
      await page.click("#frame");
      await page.waitForFunction(() => document.querySelector("#canvas").dataset.held);
      return page.getAttribute("#canvas", "data-held");
    };
    await held();
    const first = await held();
    for (let i = 0; i < Number(process.env.UPLOADS ?? 5); i++) await held();
    assert.equal(await held(), first);
  });
});

describe("the page without WebGL", { skip: noBrowser, timeout: 900_000 }, () => {
  test("refines, certifies and downloads all the same", async () => {
    const [server, browser] = await Promise.all([serve(), launch("--disable-3d-apis", "--disable-gpu")]);
    try {
      await server.ready();
      const { page, faults } = await open(browser, `${server.address}/#levels=1&look=distance`);
      assert.ok(await page.isVisible("#no-webgl"));
      await choose(page, example);
      await settled(page);
      await page.locator("#promises", { hasText: /At most [\d.]+\s% of the model’s size/ }).waitFor();
      // Tools for a picture, and a legend of its colours, would be of nothing.
      for (const id of ["#tools", "#legend"]) assert.ok(await page.isHidden(id), id);
      const { bytes } = await downloaded(page, "#download");
      assert.equal(report(bytes).totals.faces, 4 * PART_FACES);
      assert.deepEqual(faults.filter((fault) => !/WebGL/.test(fault)), []);
    } finally {
      await browser.close();
      await server.close();
    }
  });
});

/** A drop as the browser makes one: dragged over, then let go. */
async function drop(page, bytes, name) {
  const transfer = await page.evaluateHandle(
    ([base64, name]) => {
      const transfer = new DataTransfer();
      const content = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
      transfer.items.add(new File([content], name));
      return transfer;
    },
    [bytes.toString("base64"), name],
  );
  await page.dispatchEvent("#view", "dragover", { dataTransfer: transfer });
  assert.ok(await page.isVisible(".veil"));
  await page.dispatchEvent("#view", "drop", { dataTransfer: transfer });
}
