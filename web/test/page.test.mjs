/** The page against a real server, as a user meets it. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import axe from "axe-core";
import { choose, columns, downloaded, launch, noBrowser, open, openDownloadOptions, picture, settled } from "./support/browser.mjs";
import { bare, moving, positions, report } from "./support/glb.mjs";
import { serve } from "./support/server.mjs";
import { example, number, part, PART_FACES, same, studio } from "./support/studio.mjs";

/** A cube around the origin and a pyramid on its foot, without normals. */
const CUBE = obj(
  "cube.obj",
  [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => [1, 2, 4].map((bit) => (corner & bit ? 0.5 : -0.5))),
  ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"],
);
const PYRAMID = obj(
  "pyramid.obj",
  [[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 2, 0]],
  ["1 2 3 4", "2 1 5", "3 2 5", "4 3 5", "1 4 5"],
);

function obj(name, points, faces) {
  const lines = [...points.map((point) => `v ${point.join(" ")}`), ...faces.map((face) => `f ${face}`)];
  return { name, mimeType: "", buffer: Buffer.from(lines.join("\n")) };
}

describe("the page", { skip: noBrowser, timeout: 1_800_000 }, () => {
  const { visit, refined } = studio();

  test("a dropped file is refined, to the exact number of faces", async () => {
    const page = await visit();
    await drop(page, part, "part.glb");
    await settled(page);
    assert.match(await page.textContent("#label-right"), new RegExp(`· ${number(16 * PART_FACES)} faces`));
    assert.match(await page.textContent("#label-left"), new RegExp(`${number(PART_FACES)} faces`));
    const statements = await page.textContent("#promises");
    assert.match(statements, /No point is farther from the classic smooth surface than [\d.]+\u00a0% of the model’s size \(/);
    // At the end of a line a unit would stand without its number.
    assert.match(statements, /\d\u00a0c?m .*\d\u00a0%/s);
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

  test("edges that are kept sharp are among a result's sharpest", async () => {
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) => `v ${i & 1} ${(i >> 1) & 1} ${i >> 2}`);
    const sides = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"].map((side) => `f ${side}`);
    const page = await visit({ hash: "#levels=1" });
    await drop(page, Buffer.from([...corners, ...sides].join("\n")), "box.obj");
    await settled(page);
    const cells = await page.$$eval("#statistics tr:has(th:text-is('Sharpest edge')) td", (cells) =>
      cells.map(({ textContent }) => textContent));
    assert.deepEqual(cells, ["90°", "90°"]);
  });

  test("edges between materials are among the sharpest", async () => {
    const tetrahedron = bare();
    const { primitives } = tetrahedron.meshes[0];
    // The face that is slanted has a material of its own.
    tetrahedron.accessors[1].count = 9;
    tetrahedron.accessors.push({ ...tetrahedron.accessors[1], byteOffset: 18, count: 3 });
    tetrahedron.materials = [{}, {}];
    primitives.push({ ...primitives[0], indices: 2, material: 1 });
    const page = await visit({ hash: "#levels=1&look=dihedral" });
    await drop(page, Buffer.from(JSON.stringify(tetrahedron)), "two.gltf");
    await settled(page);
    const [before, after] = await page.$$eval("#statistics tr:has(th:text-is('Sharpest edge')) td", (cells) =>
      cells.map(({ textContent }) => textContent));
    assert.equal(before, "125°");
    // That which the report gives, over the whole surface.
    assert.equal(await page.textContent("#legend-high"), after);
  });

  test("of a sheet in a plane no turn is told, and what is said of planes holds for its bent boundary", async () => {
    // Thirds and sevenths: float32 rounds each place.
    const places = Array.from({ length: 25 }, (_, i) => [Math.floor(i / 5) + (i % 3) / 7, (i % 5) + (i % 2) / 3]);
    const squares = [0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13].map((i) => `f ${i + 1} ${i + 2} ${i + 7} ${i + 6}`);
    const lines = [...places.map(([x, y]) => `v ${x} ${y} ${0.7 * x - 0.3 * y}`), ...squares];
    const page = await visit({ hash: "#levels=1&look=dihedral" });
    await drop(page, Buffer.from(lines.join("\n")), "sheet.obj");
    await settled(page);
    const cells = await page.$$eval("#statistics tr:has(th:text-is('Sharpest edge')) td", (cells) =>
      cells.map(({ textContent }) => textContent));
    for (const cell of cells) assert.match(cell, /^(0|<\u00a00\.01)°$/);
    assert.equal(await page.textContent("#legend-high"), "0°");
    assert.doesNotMatch(await page.textContent("#promises"), /than 0\u00a0/);
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

  test("each half of the wipe is that half of the whole picture", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, example);
    await settled(page);
    const halves = await picture(page);
    await page.focus("#wipe");
    await page.keyboard.press("Home");
    const right = await picture(page);
    await page.focus("#wipe");
    await page.keyboard.press("End");
    const left = await picture(page);
    const middle = halves.width / 2;
    same(columns(halves, 0, middle), columns(left, 0, middle));
    same(columns(halves, middle, halves.width), columns(right, middle, halves.width));
    assert.ok(!left.data.equals(right.data));
  });

  test("on a graphics card a room lights the model, metal mirrors it, and a lost card comes back so", async () => {
    const page = await visit({ hash: "#levels=1&layout=side", card: true, viewport: { width: 560, height: 400 } });
    await choose(page, example);
    await settled(page);
    const shades = new Map();
    const { data } = await picture(page);
    for (let i = 0; i < data.length; i += 4) {
      const shade = (data[i] + data[i + 1] + data[i + 2]) >> 4;
      shades.set(shade, (shades.get(shade) ?? 0) + 1);
    }
    // Neither black, as metal is with nothing to mirror, nor without a dark side.
    const often = [...shades].filter(([, times]) => times > 20).map(([shade]) => shade);
    const [least, most] = [Math.min(...often), Math.max(...often)];
    assert.ok(least > 12 && most > 40 && most - least > 18, `from ${least} to ${most} of 47`);
    // Lost and given back it shows the same, on either side.
    await page.evaluate(() => {
      window.card = document.querySelector("#canvas").getContext("webgl2").getExtension("WEBGL_lose_context");
      window.card.loseContext();
    });
    await page.locator("#no-webgl").waitFor();
    await page.evaluate(() => window.card.restoreContext());
    await page.locator("#no-webgl").waitFor({ state: "hidden" });
    const again = await picture(page);
    const other = again.data.filter((value, i) => Math.abs(value - data[i]) > 8).length / again.data.length;
    assert.ok(other < 0.003, `${other} of the picture is another`);
  });

  test("a heat map colours the result alone, and its legend knows the report's largest number", async () => {
    // The report's turns are those of smooth edges alone.
    const page = await visit({ hash: "#levels=2&layout=side&crease=off" });
    await choose(page, example);
    await settled(page);
    const plain = await picture(page);
    const middle = plain.width / 2;
    const left = columns(plain, 0, middle);
    const [ours, loop] = await Promise.all(
      ["pns", "loop"].map((scheme) => refined(`levels=2&crease=off&scheme=${scheme}`)),
    );
    // The second level is Loop's: what the first one did is carried there.
    const [learned, last] = report(ours).levels;
    const wanted = {
      distance: largestDistance(positions(ours), positions(loop)),
      ratio: Math.max(learned.proximity_ratio.max, learned.vertex_rule.proximity_ratio.max),
      gate: Math.max(learned.gate.max, learned.vertex_rule.gate.max),
      dihedral: (last.normal_jump_max * 180) / Math.PI,
    };
    for (const [heat, end] of Object.entries(wanted)) {
      await page.selectOption("#look", heat);
      await page.locator("#legend").waitFor();
      await page.locator("#work").waitFor({ state: "hidden" });
      const shown = Number(await page.getAttribute("#legend", "data-max"));
      assert.ok(end > 0 && Math.abs(shown - end) <= 1e-5 * end, `${heat}: ${shown} is not ${end}`);
      const coloured = await picture(page);
      same(columns(coloured, 0, middle), left);
      const halves = [coloured, plain].map((shown) => columns(shown, middle, 2 * middle));
      assert.ok(!halves[0].equals(halves[1]), `${heat} changes nothing`);
    }
  });

  test("a cube that keeps its edges is coloured by its distance to Loop, whose cube has fewer vertices", async () => {
    const page = await visit({ hash: "#levels=1&look=distance" });
    await choose(page, CUBE);
    await settled(page);
    const pieces = await Promise.all(
      ["pns", "loop"].map((scheme) => refined(`levels=1&normals=smooth&scheme=${scheme}`, CUBE.buffer, "model/obj")),
    );
    // On each side a vertex has its octant, edge or face to itself.
    const [ours, loop] = pieces.map((bytes) => {
      const [places] = positions(bytes);
      const points = Array.from({ length: places.length / 3 }, (_, i) => places.slice(3 * i, 3 * i + 3));
      return new Map(points.map((point) => [point.map((x) => Math.sign(Math.trunc(5 * x))).join(), point]));
    });
    assert.deepEqual([ours.size, loop.size], [26, 26]);
    const apart = [...ours].map(([side, point]) => Math.hypot(...point.map((x, axis) => x - loop.get(side)[axis])));
    const shown = Number(await page.getAttribute("#legend", "data-max", { timeout: 1000 }));
    assert.ok(Math.abs(shown - Math.max(...apart)) < 1e-6, `${shown} is not ${Math.max(...apart)}`);
    assert.match(await page.textContent("#mathematics"), /Measured between the refined vertices/);
  });

  test("of Loop’s own result heat maps are zero, and say why", async () => {
    const page = await visit({ hash: "#levels=1&model=loop&layout=single" });
    await choose(page, example);
    await settled(page);
    const plain = await picture(page);
    for (const heat of ["distance", "ratio", "gate"]) {
      await page.selectOption("#look", heat);
      assert.ok(await page.isVisible("#legend"), heat);
      assert.equal(await page.getAttribute("#legend", "data-end"), "0");
      assert.match(await page.textContent("#legend-note"), /nothing learned/);
      assert.ok(!(await picture(page)).data.equals(plain.data), `${heat} changes nothing`);
    }
  });

  for (const viewport of [{ width: 1280, height: 800 }, { width: 640, height: 800 }]) {
    test(`side by side a legend stands between the models, not on the foot of one, at ${viewport.width}`, async () => {
      const page = await visit({ hash: "#levels=1&layout=side&look=dihedral", viewport });
      await choose(page, PYRAMID);
      await settled(page);
      const { width, height, data } = await picture(page);
      const view = await page.locator("#canvas").boundingBox();
      const legend = await page.locator("#legend").boundingBox();
      const scale = width / view.width;
      const paper = data.subarray(0, 4);
      for (let y = legend.y - view.y; y < legend.y - view.y + legend.height; y += 4) {
        for (let x = legend.x - view.x; x < legend.x - view.x + legend.width; x += 4) {
          const at = 4 * (Math.round(y * scale) * width + Math.round(x * scale));
          assert.ok(data.subarray(at, at + 4).equals(paper), `a model at ${x}, ${y} of ${width} × ${height}`);
        }
      }
    });
  }

  test("what is compared is chosen only where two sides stand", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, CUBE);
    await settled(page);
    for (const [layout, open] of Object.entries({ wipe: true, side: true, overlay: false, single: false })) {
      await page.check(`input[name="layout"][value="${layout}"]`);
      assert.equal(await page.isEnabled("#pair"), open, layout);
    }
  });

  test("choices are read whole, and stand under each other", async () => {
    const page = await visit({ hash: "#levels=1", viewport: { width: 1280, height: 800 } });
    await choose(page, example);
    await settled(page);
    await page.click(".more summary");
    const short = await page.$$eval(".row select, .tools select", (selects) => {
      const context = document.createElement("canvas").getContext("2d");
      const arrow = 18;
      return selects.flatMap((select) => {
        const { font, paddingLeft, paddingRight } = getComputedStyle(select);
        context.font = font;
        const room = select.clientWidth - parseFloat(paddingLeft) - parseFloat(paddingRight) - arrow;
        return [...select.options].map(({ text }) => text).filter((text) => context.measureText(text).width > room);
      });
    });
    assert.deepEqual(short, []);
    const edges = await page.$$eval(".more select", (selects) => selects.map((select) => select.getBoundingClientRect().left));
    assert.equal(new Set(edges).size, 1, String(edges));
    await page.selectOption("#crease", "angle");
    assert.ok(await page.$eval(".with-unit", (number) => number.scrollWidth <= number.clientWidth), "a unit stands aside");
  });

  test("nothing behind them is seen through the tools, the timeline, the legend and the labels", async () => {
    const page = await visit();
    const sheets = await page.$$eval(".tools, .timeline, .legend, .side-label", (floating) =>
      floating.map((one) => getComputedStyle(one).backgroundColor),
    );
    const panel = await page.$eval("#panel", (panel) => getComputedStyle(panel).backgroundColor);
    assert.deepEqual([...new Set(sheets)], [panel]);
  });

  test("beside a heat map a wireframe keeps its lines", async () => {
    const page = await visit({ hash: "#levels=1&layout=side" });
    await choose(page, example);
    await settled(page);
    const left = async () => {
      const shown = await picture(page);
      return columns(shown, 0, shown.width / 2);
    };
    await page.selectOption("#look", "wire");
    const wire = await left();
    await page.selectOption("#look", "distance");
    await page.locator("#legend").waitFor();
    same(await left(), wire);
  });

  test("a number that cannot be is told, and asks for nothing", async () => {
    const page = await visit({ hash: "#levels=1&crease=angle" });
    await choose(page, example);
    await settled(page);
    page.on("request", (request) => assert.notEqual(request.method(), "POST"));
    await page.evaluate(() => {
      document.querySelector("#angle").reportValidity = function () {
        window.told = this.validationMessage;
        return this.checkValidity();
      };
    });
    await page.fill("#angle", "-1");
    assert.match(await page.evaluate(() => window.told), /0/);
    await page.waitForTimeout(500);
    assert.ok(!(await page.evaluate(() => location.hash)).includes("angle=-1"));
  });

  test("beside a number that cannot be, whether it is seen or not, other settings may change", async () => {
    const page = await visit({ hash: "#levels=1&crease=angle&angle=25.5" });
    await choose(page, example);
    await settled(page);
    assert.ok(await page.$eval("#angle", (angle) => angle.validity.valid));
    await page.fill("#angle", "999");
    await page.selectOption("#levels", "2");
    await page.locator("#label-right", { hasText: `${number(16 * PART_FACES)} faces` }).waitFor({ timeout: 20_000 });
    assert.match(await page.evaluate(() => location.hash), /angle=25\.5/);
  });

  test("normals of the limit surface and the limit surface come and go together", async () => {
    const page = await visit({ hash: "#levels=1&normals=limit" });
    assert.ok(await page.isChecked("#limit"));
    await choose(page, example);
    await settled(page);
    await page.click(".more summary");
    await page.uncheck("#limit");
    assert.equal(await page.inputValue("#normals"), "auto");
    await page.selectOption("#normals", "limit");
    assert.ok(await page.isChecked("#limit"));
  });

  test("a link restores the settings", async () => {
    const page = await visit();
    await choose(page, example);
    await settled(page);
    await page.selectOption("#levels", "1");
    await page.selectOption("#model", "loop");
    await page.selectOption("#look", "zebra");
    await page.focus("#canvas");
    await page.keyboard.press("n");
    await page.selectOption("#crease", "angle");
    await page.fill("#angle", "25");
    await page.waitForFunction(() => location.hash.includes("angle=25"));
    const hash = await page.evaluate(() => location.hash);
    const other = await visit({ hash });
    for (const [id, value] of [["levels", "1"], ["look", "zebra"], ["crease", "angle"], ["angle", "25"]]) {
      assert.equal(await other.inputValue(`#${id}`), value);
    }
    assert.ok(await other.isChecked("#normal-lines"));
    await other.waitForFunction(() => document.querySelector("#model").value === "loop");
  });

  test("a link restores the camera, of a model of any size, until another file comes", async () => {
    const page = await visit({ hash: "#levels=1&layout=single" });
    await choose(page, CUBE);
    await settled(page);
    const framed = await picture(page);
    assert.ok(!(await page.evaluate(() => location.hash)).includes("camera"));
    for (const key of ["ArrowRight", "ArrowRight", "ArrowUp", "-"]) await page.press("#canvas", key);
    await page.waitForFunction(() => location.hash.includes("camera"));
    const turned = await picture(page);
    const hash = await page.evaluate(() => location.hash);
    const other = await visit({ hash });
    const large = { ...CUBE, buffer: Buffer.from(CUBE.buffer.toString().replaceAll("0.5", "50")) };
    await choose(other, large);
    await settled(other);
    const restored = await picture(other);
    const share = (a, b) => a.data.filter((value, i) => Math.abs(value - b.data[i]) > 8).length / a.data.length;
    assert.ok(share(restored, turned) < 0.003 && share(restored, framed) > 0.01);
    await choose(other, CUBE);
    await settled(other);
    assert.ok(!(await other.evaluate(() => location.hash)).includes("camera"));
    assert.ok(share(await picture(other), framed) < 0.003);
    // Six numbers, or nothing.
    for (const camera of ["", "1,2,3", "1,2,3,4,5,x", "1e9,0,0,0,0,0"]) {
      await other.evaluate((camera) => (location.hash = `#levels=1&layout=single&camera=${camera}`), camera);
      await other.waitForFunction(() => !location.hash.includes("camera"));
      assert.ok(share(await picture(other), framed) < 0.003, camera);
    }
  });

  test("a link that is followed in the page’s own tab changes the settings there", async () => {
    const page = await visit({ hash: "#levels=1&look=zebra" });
    await choose(page, example);
    await settled(page);
    await page.evaluate(() => (location.hash = "#levels=2&edges=1&layout=side"));
    await page.locator("#label-right", { hasText: `${number(16 * PART_FACES)} faces` }).waitFor();
    assert.ok(await page.isChecked("#edges"));
    assert.ok(await page.isChecked('input[value="side"]'));
    assert.equal(await page.inputValue("#look"), "material");
    await settled(page);
    // The way past the canvas is no setting.
    await page.locator(".skip").press("Enter");
    assert.ok(await page.evaluate(() => document.activeElement.id === "panel" && location.hash.includes("edges=1")));
  });

  test("without a mouse: the example, the view, the wipe", async () => {
    const page = await visit({ hash: "#levels=1" });
    await page.focus("#example");
    await page.keyboard.press("Enter");
    await settled(page);
    await page.focus("#canvas");
    const before = await picture(page);
    await page.focus("#canvas");
    for (const key of ["ArrowRight", "ArrowUp", "-"]) await page.keyboard.press(key);
    const turned = await picture(page);
    assert.ok(!turned.data.equals(before.data));
    await page.focus("#canvas");
    await page.keyboard.press("f");
    same((await picture(page)).data, before.data);
    await page.focus("#canvas");
    await page.keyboard.press("3");
    assert.ok(await page.isChecked('input[value="overlay"]'));
    await page.keyboard.press("1");
    await page.press("#wipe", "ArrowUp");
    assert.equal(await page.getAttribute("#wipe", "aria-valuenow"), "52");
  });

  test("a screen reader hears each step once, and no percents of it", async () => {
    const page = await visit({ hash: "#levels=4&model=signed" });
    await page.evaluate(() => {
      window.heard = [];
      const hear = ({ target }) => {
        const region = (target instanceof Element ? target : target.parentElement).closest("[role=status], [role=alert]");
        if (region) window.heard.push(region.textContent);
      };
      new MutationObserver((changes) => changes.forEach(hear)).observe(document.body, {
        subtree: true,
        childList: true,
        characterData: true,
      });
    });
    await choose(page, example);
    await settled(page);
    const heard = await page.evaluate(() => window.heard);
    assert.deepEqual(heard.slice(0, 2), ["Opening the file", "Uploading"]);
    assert.match(heard.at(-1), /^Done\. /);
    assert.deepEqual(heard.slice(0, -1).filter((text) => /\d|^$/.test(text)), []);
    assert.ok(heard.every((text, i) => text !== heard[i - 1]), heard.join(" | "));
  });

  test("words may be dropped into a field", async () => {
    const page = await visit();
    const words = await page.evaluateHandle(() => {
      const transfer = new DataTransfer();
      transfer.setData("text/plain", "3");
      return transfer;
    });
    await page.dispatchEvent("#angle", "drop", { dataTransfer: words });
    // What is dropped is read in the same turn.
    await page.waitForTimeout(100);
    assert.ok(await page.isHidden("#problem"));
  });

  for (const colorScheme of ["light", "dark"]) {
    test(`axe finds no serious fault (${colorScheme})`, async () => {
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
    await page.check("#limit");
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
    await page.route(/\/jobs\?/, (route) => route.abort());
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
      assert.match(await page.textContent("#promises"), /No point is farther/);
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

async function unfold(page) {
  await page.evaluate(() => document.querySelectorAll("details").forEach((part) => (part.open = true)));
}

async function faultsOf(page) {
  // Evaluated by the driver: the page's policy lets no script of ours in.
  const { violations } = await page.evaluate(`${axe.source}; axe.run({ resultTypes: ["violations"] })`);
  return violations
    .filter(({ impact }) => impact === "serious" || impact === "critical")
    .map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 120)).join(" | ")}`);
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

function largestDistance(ours, loop) {
  let largest = 0;
  for (const [number, points] of ours.entries()) {
    for (let i = 0; i < points.length; i += 3) {
      const apart = [0, 1, 2].map((k) => points[i + k] - loop[number][i + k]);
      largest = Math.max(largest, Math.hypot(...apart));
    }
  }
  return largest;
}
