/** The first minute: what a stranger sees, reads and gets. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import { strToU8, zipSync } from "three/addons/libs/fflate.module.js";
import { bodyOf, choose, downloaded, hold, noBrowser, picture, settled } from "./support/browser.mjs";
import { positions, read, rigged, write } from "./support/glb.mjs";
import { CUBE, CUBE_OF_TRIANGLES } from "./support/solids.mjs";
import { example, number, PART_FACES, same, studio, TETRAHEDRON } from "./support/studio.mjs";

describe("the first minute", { skip: noBrowser, timeout: 1_800_000 }, () => {
  const { visit, refined } = studio();

  test("the page shows an example at once, refined by the service, until the user has a file", async () => {
    const page = await visit({ live: true });
    await page.addInitScript(() => {
      window.said = [];
      new MutationObserver(() => {
        const text = document.querySelector("#work-text")?.textContent;
        if (text) window.said.push(text);
      }).observe(document, { subtree: true, childList: true });
    });
    await page.reload();
    await settled(page);
    // The visitor has uploaded nothing.
    const said = await page.evaluate(() => window.said);
    assert.ok(said.length);
    assert.deepEqual(said.filter((text) => /Upload|Waiting/.test(text)), []);
    assert.equal(await page.textContent("#file-name"), "example.glb");
    assert.match(await page.textContent("#label-right"), /· 15,744 faces/);
    assert.ok(await page.isVisible("#invitation"));
    assert.ok(await page.isHidden("#welcome"));
    await choose(page, TETRAHEDRON);
    await page.locator("#file-name", { hasText: "tetrahedron.obj" }).waitFor();
    await settled(page);
    assert.ok(await page.isHidden("#invitation"));
  });

  test("a file that is chosen while the example is on its way takes its place", async () => {
    const page = await visit({ live: true, hash: "#levels=1" });
    await choose(page, TETRAHEDRON);
    await settled(page);
    await page.waitForTimeout(1000);
    await settled(page);
    assert.equal(await page.textContent("#file-name"), "tetrahedron.obj");
  });

  test("an example that does not come leaves the welcome, without a word of a fault", async () => {
    const page = await visit({ live: true, foreseen: /ERR_FAILED/ });
    await page.route(/\/subdivide\?/, (route) => route.abort());
    await page.reload();
    await page.waitForEvent("requestfailed");
    await page.locator("#work").waitFor({ state: "hidden" });
    await page.locator("#welcome").waitFor();
    assert.ok(await page.isHidden("#problem"));
    await page.unroute(/\/subdivide\?/);
    await page.click("#example");
    await settled(page);
  });

  for (const viewport of [{ width: 1366, height: 768 }, { width: 1920, height: 1080 }, { width: 390, height: 844 }]) {
    test(`at ${viewport.width} × ${viewport.height} the download is in view, whatever is unfolded`, async () => {
      const page = await visit({ hash: "#levels=1", viewport });
      await choose(page, CUBE);
      await settled(page);
      const isSeen = () => page.$eval("#download", (button) => {
        const { left, right, top, bottom } = button.getBoundingClientRect();
        const there = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
        return there === button && bottom <= innerHeight;
      });
      assert.ok(await isSeen());
      await page.evaluate(() => document.querySelectorAll("details").forEach((part) => (part.open = true)));
      assert.ok(await isSeen());
    });
  }

  for (const [file, format, type] of [
    [{ ...TETRAHEDRON, name: "a.obj" }, "obj", "model/obj"],
    [off(), "off", "model/off"],
    [print(), "3mf", "model/3mf"],
    [{ ...example, name: "a.glb" }, "glb", "model/gltf-binary"],
  ]) {
    test(`${file.name} comes back in its own format, and in others on demand`, async () => {
      const page = await visit({ hash: "#levels=1" });
      await choose(page, file);
      await settled(page);
      for (const wanted of [format, "stl"]) {
        if (wanted !== format) await page.selectOption("#format", wanted);
        const { name, bytes } = await downloaded(page, "#download");
        assert.equal(name, `a-refined.${wanted}`);
        same(bytes, await refined(`levels=1&format=${wanted}`, file.buffer, type));
      }
    });
  }

  test("the parts of a 3MF are shown where its result is", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, print());
    await settled(page);
    assert.match(await page.textContent("#label-left"), /8 faces/);
    await page.locator("#promises", { hasText: "measured from each surface" }).waitFor();
    const [, most] = /At most ([\d.]+)\u00a0%/.exec(await page.textContent("#promises"));
    assert.ok(Number(most) < 30, most);
  });

  test("an upload that shrinks by compression is sent compressed", async () => {
    const page = await visit({ hash: "#levels=1" });
    const coming = page.waitForRequest(/\/subdivide\?/);
    const text = `${TETRAHEDRON.buffer}${"# a comment\n".repeat(1000)}`;
    await choose(page, { ...TETRAHEDRON, buffer: Buffer.from(text) });
    const sent = await coming;
    assert.equal(sent.headers()["content-encoding"], "gzip");
    assert.ok(sent.postDataBuffer().length < text.length / 10);
    assert.equal(String(bodyOf(sent)), text);
    await settled(page);
    assert.match(await page.textContent("#label-right"), /· 16 faces/);
  });

  test("a cube is offered no rounder shape; where edges are in doubt buttons lead to both", async () => {
    const page = await visit();
    await choose(page, CUBE);
    await settled(page);
    assert.ok(await page.isHidden("#advice"));
    // Of a gem or a ball of few faces no network knows which.
    const advice = "22 of 40 steep edges are neither clearly sharp nor clearly round: use crease=off for a body that is " +
      "round throughout, or crease=angle:40 for flat sides with crisp edges";
    await page.route(/\/subdivide\?/, async (route) => {
      const isAuto = route.request().url().includes("crease=auto");
      const answer = await route.fetch();
      const body = await answer.body();
      const headers = { "Content-Type": answer.headers()["content-type"] };
      await route.fulfill({ headers, body: isAuto ? advised(body, advice) : body });
    });
    for (const [label, value] of [["Round throughout", "off"], ["Crisp edges", "angle"]]) {
      await choose(page, { ...TETRAHEDRON, name: `${value}.obj` });
      await page.locator("#advice", { hasText: "“Crisp edges” for flat sides" }).waitFor();
      await settled(page);
      assert.deepEqual(await page.locator("#advice button").allTextContents(), ["Round throughout", "Crisp edges"]);
      await page.getByRole("button", { name: label }).click();
      assert.equal(await page.inputValue("#crease"), value);
      await page.locator("#advice").waitFor({ state: "hidden" });
      await settled(page);
    }
    assert.equal(await page.inputValue("#angle"), "40");
  });

  test("faces that only touch are told of, and joined by the setting that is named", async () => {
    const page = await visit({ hash: "#levels=1" });
    // Two triangles whose common edge is open by a hundred-thousandth.
    const text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1.00001 0 0\nv 0 1.00001 0\nv 1 1 1\nf 1 2 3\nf 4 6 5\n";
    await choose(page, { name: "gap.obj", mimeType: "", buffer: Buffer.from(text) });
    await settled(page);
    const boundary = () => page.textContent("#statistics tr:has-text('Boundary edges') td:last-child");
    assert.equal(await boundary(), "6");
    assert.match(await page.textContent("#advice-text"), /use “Close small gaps” to join vertices/);
    await page.getByRole("button", { name: "Close small gaps" }).click();
    await page.waitForFunction(() => document.querySelector("#statistics").textContent.includes("Boundary edges64"));
  });

  test("halves of quads in a glTF are joined by the setting, and refined by Catmull–Clark", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, CUBE_OF_TRIANGLES);
    await settled(page);
    const rule = () => page.textContent("#mathematics");
    assert.match(await rule(), /Loop/);
    await page.click("#settings .more summary");
    await page.check("#polygons");
    await page.waitForFunction(() => document.querySelector("#mathematics").textContent.includes("Catmull–Clark"));
    assert.match(page.url(), /polygons=true/);
  });

  test("each setting in view explains itself to the pointer and to the keyboard", async () => {
    const page = await visit();
    await page.evaluate(() => document.querySelectorAll("details").forEach((part) => (part.open = true)));
    const controls = await page.$$eval(":is(#settings, #research) .row :is(select, input)", (all) =>
      all.filter((control) => control.getClientRects().length).map(({ id }) => `#${id}`),
    );
    assert.ok(controls.length >= 7, String(controls));
    await page.locator("#strength:enabled").waitFor();
    for (const control of controls) {
      const tip = page.locator(`.row:has(${control}) .tip`);
      await page.mouse.move(10, 10);
      await page.hover(`.row:has(${control}) label`);
      await tip.waitFor();
      await page.mouse.move(10, 10);
      await tip.waitFor({ state: "hidden" });
      await page.keyboard.press("Shift");
      await page.focus(control);
      await page.keyboard.press("Shift");
      await tip.waitFor();
      assert.ok((await tip.textContent()).trim().length > 40);
      // The settings and the picture stay in view.
      const [box, sheet] = [await tip.boundingBox(), await page.locator(".sheet").boundingBox()];
      assert.ok(box.x >= sheet.x && box.y >= sheet.y + sheet.height && box.y + box.height <= 700, control);
      assert.ok(await tip.evaluate(({ scrollHeight, clientHeight }) => scrollHeight <= clientHeight), control);
      await page.evaluate(() => document.activeElement.blur());
    }
  });

  test("strength is a share of the model's own budget, and zero is the classic surface", async () => {
    const page = await visit({ hash: "#levels=1&crease=off&look=distance" });
    await choose(page, example);
    await settled(page);
    assert.ok(Number(await page.getAttribute("#legend", "data-max")) > 0);
    await page.click("#research summary");
    const asked = page.waitForRequest(/budget=0(&|$)/);
    await page.fill("#strength", "0");
    await asked;
    await page.locator("#strength-text", { hasText: "0 %" }).waitFor();
    await page.waitForFunction(() => Number(document.querySelector("#legend").dataset.max) < 1e-6);
    await settled(page);
  });

  test("each rule is described in a sentence", async () => {
    const page = await visit();
    await page.click(".more summary");
    await page.locator("#strength:enabled").waitFor({ state: "attached" });
    const names = await page.$$eval("#model option", (options) => options.map(({ value, text }) => [value, text]));
    for (const [value, text] of names) {
      if (text === "full") continue;
      await page.selectOption("#model", value);
      assert.match(await page.textContent("#model-note"), /\w+ \w+.*\.$/, text);
    }
  });

  test("the opening camera looks at the front, +Z, from thirty degrees beside it and a little above", async () => {
    const page = await visit({ hash: "#levels=1&layout=side" });
    await choose(page, CUBE);
    await settled(page);
    // A zoom keeps the direction, and writes the camera into the address.
    await page.press("#canvas", "-");
    await page.waitForFunction(() => location.hash.includes("camera"));
    const place = await page.evaluate(() => new URLSearchParams(location.hash.slice(1)).get("camera"));
    const [x, y, z, ...target] = place.split(",").map(Number);
    assert.ok(Math.hypot(...target) < 1e-3);
    const degrees = (radians) => (radians * 180) / Math.PI;
    assert.ok(Math.abs(degrees(Math.atan2(x, z)) - 30) < 1, place);
    const above = degrees(Math.atan2(y, Math.hypot(x, z)));
    assert.ok(above > 10 && above < 25, place);
  });

  test("a heat map keeps its colours for 98 of 100 vertices, and names the largest value", async () => {
    const page = await visit({ hash: "#levels=2&look=dihedral&crease=off" });
    // One spike in a wide sheet.
    const side = 24;
    const points = Array.from({ length: side ** 2 }, (_, i) => [i % side, i === 300 ? 5 : 0.02 * Math.sin(i), Math.floor(i / side)]);
    const faces = points.flatMap((_, i) =>
      i % side < side - 1 && i < side * (side - 1) ? [`f ${i + 1} ${i + side + 1} ${i + side + 2} ${i + 2}`] : [],
    );
    const text = [...points.map((point) => `v ${point.join(" ")}`), ...faces].join("\n");
    await choose(page, { name: "spike.obj", mimeType: "", buffer: Buffer.from(text) });
    await settled(page);
    const { end, max } = await page.$eval("#legend", ({ dataset }) => dataset);
    assert.ok(Number(end) > 0 && Number(end) < Number(max) / 3, `${end} of ${max}`);
    assert.match(await page.textContent("#legend-high"), /^≥ /);
    assert.match(await page.textContent("#legend-note"), new RegExp(`largest is ${Math.round(max)}`));
  });

  test("a model stands on the ground: a shadow lies there, and not above it", async () => {
    const page = await visit({ hash: "#levels=1&layout=single" });
    await choose(page, CUBE);
    await settled(page);
    const shaded = await picture(page);
    await page.selectOption("#look", "zebra");
    const bare = await picture(page);
    const { width, height } = shaded;
    const paper = bare.data.subarray(0, 4);
    let [below, above] = [0, 0];
    for (let i = 0; i < width * height; i++) {
      const at = 4 * i;
      // Where nothing but the ground is.
      if (!bare.data.subarray(at, at + 4).equals(paper) || shaded.data.subarray(at, at + 4).equals(paper)) continue;
      if (i > (width * height) / 2) below++;
      else above++;
    }
    assert.ok(below > 0.005 * width * height, `${below} pixels of shadow`);
    assert.equal(above, 0);
  });

  test("the focus is never lost with the control that had it", async () => {
    const page = await visit({ hash: "#levels=1", foreseen: /ERR_FAILED/ });
    const focused = () => page.evaluate(() => document.activeElement.id);
    await page.locator("#example").press("Enter");
    await page.locator("#welcome").waitFor({ state: "hidden" });
    await settled(page);
    assert.equal(await focused(), "canvas");
    const release = await hold(page);
    await page.selectOption("#levels", "2");
    await page.locator("#cancel:visible").focus();
    release();
    await settled(page);
    assert.equal(await focused(), "canvas");
    await page.route(/\/subdivide\?/, (route) => route.abort());
    await page.selectOption("#levels", "3");
    await page.locator("#problem-close").press("Enter");
    assert.equal(await focused(), "canvas");
    await page.unroute(/\/subdivide\?/);
    await page.focus("#levels");
    await page.selectOption("#levels", "1");
    await page.locator("#label-right", { hasText: "3,936 faces" }).waitFor();
    await settled(page);
    assert.equal(await focused(), "levels");
  });

  test("how far result and file are apart is measured both ways, over the surfaces, in per cent of the size", async () => {
    const page = await visit({ hash: "#levels=1&crease=off&limit=false&model=loop" });
    // A ridge of two faces: Loop takes its middle half of the way down, and leaves the borders where they are.
    const text = "v 0 0 0\nv 4 0 0\nv 2 3 0\nv 2 0 3\nf 1 2 3\nf 2 1 4\n";
    await choose(page, { name: "ridge.obj", mimeType: "", buffer: Buffer.from(text) });
    await settled(page);
    const body = Buffer.from(text);
    const [places] = positions(await refined("levels=1&crease=off&limit=false&scheme=loop&normals=smooth", body, "model/obj"));
    const spots = Array.from({ length: places.length / 3 }, (_, i) => [...places.subarray(3 * i, 3 * i + 3)]);
    const file = [[[0, 0, 0], [4, 0, 0], [2, 3, 0]], [[4, 0, 0], [0, 0, 0], [2, 0, 3]]];
    // The corners that are cut off are the farthest: vertices of the file, from the result's.
    const apart = Math.max(...file.flat().map((corner) => Math.min(...spots.map((spot) => Math.hypot(...spot.map((x, i) => x - corner[i]))))));
    await page.locator("#promises", { hasText: "measured from each surface" }).waitFor();
    const [, most, mean] = /At most ([\d.]+)\u00a0%.*, ([\d.]+)\u00a0% on average/.exec(await page.textContent("#promises"));
    const size = Math.hypot(4, 3, 3);
    assert.ok(Number(most) / 100 <= (apart / size) * 1.02 && Number(most) / 100 > apart / size / 2, `${most} of ${(100 * apart) / size}`);
    assert.ok(Number(mean) > 0 && Number(mean) < Number(most) / 2);
  });

  test("settings and heat maps are for one file, unless they are pinned or a link names them", async () => {
    const page = await visit();
    await choose(page, CUBE);
    await settled(page);
    assert.ok(await page.isHidden("#kept"));
    await page.selectOption("#crease", "off");
    await page.selectOption("#look", "distance");
    await page.locator("#legend").waitFor();
    await choose(page, TETRAHEDRON);
    await page.locator("#file-name", { hasText: "tetrahedron" }).waitFor();
    await settled(page);
    assert.equal(await page.inputValue("#crease"), "auto");
    assert.equal(await page.inputValue("#look"), "material");
    assert.ok(await page.isHidden("#kept"));
    assert.equal(await page.evaluate(() => location.hash), "");
    await page.selectOption("#crease", "off");
    await page.check("#pin");
    await choose(page, CUBE);
    await page.locator("#file-name", { hasText: "cube" }).waitFor();
    await settled(page);
    assert.equal(await page.inputValue("#crease"), "off");
    await page.click("#reset");
    assert.ok(await page.isHidden("#kept"));
    assert.equal(await page.inputValue("#crease"), "auto");
    await settled(page);
    const linked = await visit({ hash: "#levels=1" });
    assert.ok(await linked.isChecked("#pin"));
    for (const file of [CUBE, TETRAHEDRON]) {
      await choose(linked, file);
      await settled(linked);
    }
    assert.equal(await linked.inputValue("#levels"), "1");
  });

  for (const viewport of [{ width: 1366, height: 768 }, { width: 390, height: 844 }]) {
    test(`at ${viewport.width} pixels download and progress are in view while settings are hidden`, async () => {
      const page = await visit({ hash: "#levels=1", viewport });
      await choose(page, CUBE);
      await settled(page);
      await page.click("#fold");
      const release = await hold(page);
      await page.evaluate(() => (location.hash = "#levels=2"));
      await page.locator("#work").waitFor();
      for (const id of ["download", "cancel"]) {
        const isSeen = await page.$eval(`#${id}`, (button) => {
          const { left, right, top, bottom } = button.getBoundingClientRect();
          return document.elementFromPoint((left + right) / 2, (top + bottom) / 2) === button && bottom <= innerHeight;
        });
        assert.ok(isSeen, id);
      }
      // What is shown is out of date, and says so.
      assert.ok(Number(await page.$eval("#canvas", (canvas) => getComputedStyle(canvas).opacity)) < 0.6);
      release();
      await settled(page);
      assert.equal(await page.$eval("#canvas", (canvas) => getComputedStyle(canvas).opacity), "1");
    });
  }

  test("the shadow is one for both sides: it does not change where the wipe moves", async () => {
    const page = await visit({ hash: "#levels=2&crease=off&model=loop" });
    await choose(page, CUBE);
    await settled(page);
    const shots = {};
    for (const look of ["zebra", "material"]) {
      await page.selectOption("#look", look);
      for (const key of ["Home", "End"]) {
        await page.press("#wipe", key);
        shots[look + key] = (await picture(page)).data;
      }
    }
    const pixel = (shot, at) => shots[shot].readUInt32LE(at);
    const paper = pixel("zebraHome", 0);
    let shadow = 0;
    for (let at = 0; at < shots.zebraHome.length; at += 4) {
      // Where neither model is.
      if (pixel("zebraHome", at) !== paper || pixel("zebraEnd", at) !== paper) continue;
      assert.equal(pixel("materialHome", at), pixel("materialEnd", at));
      shadow += Number(pixel("materialHome", at) !== paper);
    }
    assert.ok(shadow > 1000, `${shadow} pixels of shadow`);
  });

  test("of a rigged file with many faces a click asks for fewer, where the surface bends", async () => {
    const page = await visit({ hash: "#levels=3" });
    const release = await hold(page, (_, url) => !/max_faces/.test(url));
    await choose(page, { ...example, buffer: rigged(example.buffer) });
    await page.locator("#levels-note", { hasText: "Many faces for a game" }).waitFor();
    assert.equal(await page.textContent("#offer"), "Only where it bends: at most 5,000 faces");
    await page.click("#offer");
    assert.equal(await page.textContent("#detail-text"), "≤ 5,000");
    assert.ok(await page.isHidden("#offer"));
    await settled(page);
    const [, faces] = /Only where it bends · ([\d,]+) faces/.exec(await page.textContent("#label-right"));
    assert.ok(Number(faces.replace(",", "")) > 4900 && Number(faces.replace(",", "")) <= 5000, faces);
    assert.match(await page.textContent("#promises"), /Faces where it bends/);
    assert.match(await page.evaluate(() => location.hash), /faces=5000/);
    await page.selectOption("#levels", "1");
    assert.ok(await page.isHidden("#detail"));
    await page.selectOption("#levels", "3");
    await choose(page, { ...example, name: "still.glb" });
    await page.locator("#file-name", { hasText: "still.glb" }).waitFor();
    assert.ok(await page.isHidden("#offer"));
    assert.equal(await page.textContent("#levels-note"), "");
    await page.click("#cancel");
    release();
  });

  test("detail is the most faces of the result; polygons have none, and the list says why", async () => {
    const page = await visit({ hash: "#levels=1&limit=false&uv=smooth" });
    await choose(page, CUBE_OF_TRIANGLES);
    await settled(page);
    await page.selectOption("#levels", "bends");
    await page.locator("#label-right", { hasText: "Only where it bends" }).waitFor();
    await page.fill("#detail", "3");
    assert.equal(await page.getAttribute("#detail", "aria-valuetext"), "at most 200 faces");
    await page.locator("#label-right", { hasText: /1[5-9]\d faces|200 faces/ }).waitFor();
    assert.ok(await page.isDisabled("#uv"));
    await page.focus("#detail");
    await page.keyboard.press("Shift");
    await page.locator(".row:has(#detail) .tip").waitFor();
    await choose(page, CUBE);
    await page.locator("#file-name", { hasText: CUBE.name }).waitFor();
    await settled(page);
    assert.equal(await page.textContent('#levels option[value="bends"]'), "Only where it bends: for triangles");
    assert.ok(await page.locator('#levels option[value="bends"]').isDisabled());
  });

  test("lengths are in per cent of the model's size first, and the file's unit second", async () => {
    const page = await visit({ hash: "#levels=1&look=distance" });
    await choose(page, example);
    await settled(page);
    assert.match(await page.textContent("#legend-high"), /[\d.]+\u00a0% \([\d.]+\u00a0[cm]?m\)$/);
    assert.match(await page.textContent("#label-left"), new RegExp(number(PART_FACES)));
  });
});

/** The same answer with other advice in its report. */
function advised(body, advice) {
  const text = body.toString("latin1");
  const begin = text.indexOf("glTF");
  const whole = body.subarray(begin, begin + body.readUInt32LE(begin + 8));
  const { json, bin } = read(whole);
  json.asset.extras.pns.advice = [{ text: advice, options: ["crease=off", "crease=angle:40"] }];
  const changed = write({ json, bin });
  const head = text.slice(0, begin).replace(`: ${whole.length}\r\n`, `: ${changed.length}\r\n`);
  return Buffer.concat([Buffer.from(head, "latin1"), changed, body.subarray(begin + whole.length)]);
}

/** The tetrahedron as OFF. */
/** A sphere of 3MF in a part of the package of its own, in inches, mirrored and moved. */
function print() {
  const core = 'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"';
  const production = 'xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06"';
  const ends = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
  const faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
  const mesh = `<mesh><vertices>${ends.map(([x, y, z]) => `<vertex x="${x}" y="${y}" z="${z}"/>`).join("")}</vertices>
    <triangles>${faces.map(([a, b, c]) => `<triangle v1="${a}" v2="${b}" v3="${c}"/>`).join("")}</triangles></mesh>`;
  const files = {
    "_rels/.rels": `<Relationships><Relationship Target="/3D/a.model"
      Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>`,
    "3D/a.model": `<model unit="inch" ${core} ${production}><resources><object id="1"><components>
      <component p:path="/3D/b.model" objectid="7" transform="-1 0 0 0 1 0 0 0 3 5 0 0"/></components></object>
      </resources><build><item objectid="1" transform="1 0 0 0 1 0 0 0 1 0 9 0"/></build></model>`,
    "3D/b.model": `<model ${core}><resources><object id="7">${mesh}</object></resources><build/></model>`,
  };
  const bytes = zipSync(Object.fromEntries(Object.entries(files).map(([name, text]) => [name, strToU8(text)])));
  return { name: "a.3mf", mimeType: "", buffer: Buffer.from(bytes) };
}

function off() {
  const text = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n";
  return { name: "a.off", mimeType: "", buffer: Buffer.from(text) };
}
