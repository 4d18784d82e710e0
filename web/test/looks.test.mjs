/** Pictures: the wipe, light, heat maps and their legends. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import { choose, columns, noBrowser, picture, settled } from "./support/browser.mjs";
import { largestTurn, positions, report } from "./support/glb.mjs";
import { CUBE, PYRAMID } from "./support/solids.mjs";
import { example, same, studio } from "./support/studio.mjs";

describe("pictures", { skip: noBrowser, timeout: 1_800_000 }, () => {
  const { visit, refined } = studio();

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
    const [learned] = report(ours).levels;
    const wanted = {
      distance: largestDistance(positions(ours), positions(loop)),
      ratio: Math.max(learned.proximity_ratio.max, learned.vertex_rule.proximity_ratio.max),
      gate: Math.max(learned.gate.max, learned.vertex_rule.gate.max),
      dihedral: largestTurn(ours),
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

  test("a cube that keeps its edges is coloured by its distance to the classic rule, whose cube has fewer vertices", async () => {
    const page = await visit({ hash: "#levels=1&look=distance" });
    await choose(page, CUBE);
    await settled(page);
    const pieces = await Promise.all(
      ["auto", "catmull-clark"].map((scheme) => refined(`levels=1&normals=smooth&scheme=${scheme}`, CUBE.buffer, "model/obj")),
    );
    // On each side a vertex has its octant, edge or face to itself.
    const [ours, loop] = pieces.map((bytes) => {
      const [places] = positions(bytes);
      const points = Array.from({ length: places.length / 3 }, (_, i) => places.slice(3 * i, 3 * i + 3));
      return new Map(points.map((point) => [point.map((x) => Math.sign(Math.trunc(5 * x))).join(), point]));
    });
    assert.deepEqual([ours.size, loop.size], [26, 26]);
    const apart = [...ours].map(([side, point]) => Math.hypot(...point.map((x, axis) => x - loop.get(side)[axis])));
    const shown = Number(await page.getAttribute("#legend", "data-max"));
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
      assert.match(await page.textContent("#legend-note"), /^Nothing learned/);
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
});

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
