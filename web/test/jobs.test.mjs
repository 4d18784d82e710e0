/** What the user asks for while something is under way. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import { choose, downloaded, hold, noBrowser, picture, settled } from "./support/browser.mjs";
import { broken, read, report, write } from "./support/glb.mjs";
import { example, number, part, PART_FACES, same, studio, TETRAHEDRON } from "./support/studio.mjs";

// One level of the example, five of the tetrahedron.
const FEW = { PNS_FACES: "20000" };
const UNSHOWABLE = { "a cut answer": part.subarray(0, 64), "an answer": endless(part) };

describe("a second file", { skip: noBrowser, timeout: 1_800_000 }, () => {
  const { visit, refined } = studio(FEW);

  /** A page that shows the refined tetrahedron. */
  async function first(options = {}) {
    const page = await visit({ hash: "#levels=1", ...options });
    await choose(page, TETRAHEDRON);
    await settled(page);
    return page;
  }

  test("is shown at once, with its name, and refined after that", async () => {
    const page = await first();
    const release = await hold(page, (body) => body?.equals(part));
    await choose(page, example);
    await page.locator("#label-left", { hasText: `${number(PART_FACES)} faces` }).waitFor();
    assert.equal(await page.textContent("#file-name"), "part.glb");
    assert.equal(await page.title(), "part.glb – PNS");
    assert.ok(await page.isHidden("#label-right"));
    assert.ok(await page.isHidden("#download"));
    release();
    await settledWith(page, 4 * PART_FACES);
  });

  test("that is refused gives way to the first, with its result, its lines and its settings", async () => {
    const page = await first({ hash: "#levels=4&layout=side&look=wire", expected: [422] });
    const { data } = await picture(page);
    const { json, bin } = read(part);
    json.accessors[json.meshes[0].primitives[0].indices].count = 2;
    await choose(page, { ...example, name: "short.glb", buffer: write({ json, bin }) });
    await page.locator("#problem").waitFor();
    assert.match(await page.textContent("#problem-pointer"), /^in short\.glb/);
    assert.equal(await page.textContent("#file-name"), TETRAHEDRON.name);
    same((await picture(page)).data, data);
    assert.equal(await page.inputValue("#levels"), "4");
    await page.selectOption("#format", "glb");
    assert.equal(report((await downloaded(page, "#download")).bytes).totals.faces, 4 ** 5);
  });

  test("that is cancelled stays as it came, and can be refined after all", async () => {
    const page = await first();
    const release = await hold(page, (body) => body?.equals(part));
    await choose(page, example);
    await page.locator("#label-left", { hasText: number(PART_FACES) }).waitFor();
    await page.locator("#cancel").press("Enter");
    assert.equal(await page.textContent("#notice-text"), "part.glb: cancelled");
    assert.equal(await page.textContent("#file-name"), "part.glb");
    release();
    await page.locator("#again:focus").press("Enter");
    await settledWith(page, 4 * PART_FACES);
    assert.ok(await page.isHidden("#notice"));
  });

  test("that is refused leaves a first one to be refined that it ended", async () => {
    const page = await visit({ hash: "#levels=1", expected: [422] });
    const release = await hold(page, (body) => body?.equals(TETRAHEDRON.buffer));
    await choose(page, TETRAHEDRON);
    await page.locator("#label-left", { hasText: "4 faces" }).waitFor();
    const { json, bin } = read(part);
    json.accessors[json.meshes[0].primitives[0].indices].count = 2;
    await choose(page, { ...example, name: "short.glb", buffer: write({ json, bin }) });
    await page.locator("#problem").waitFor();
    release();
    await settledWith(page, 16);
    assert.equal(await page.textContent("#file-name"), TETRAHEDRON.name);
  });

  test("does not take levels from the files after it", async () => {
    const page = await visit({ hash: "#levels=4" });
    await choose(page, example, TETRAHEDRON);
    await settled(page);
    for (const [number, levels] of [[1, "4"], [0, "1"], [1, "4"]]) {
      await page.selectOption("#file", String(number));
      await page.waitForFunction((levels) => document.querySelector("#levels").value === levels, levels);
      await settled(page);
    }
    // What the user wants stands in the address, and not what one file makes of it.
    await page.check("#edges");
    assert.match(await page.evaluate(() => location.hash), /levels=4/);
  });

  test("leaves a download of the first on its way", async () => {
    const page = await first();
    const release = await hold(page, (_, url) => url.includes("format=obj"));
    const coming = page.waitForEvent("download");
    await page.click("#download");
    await choose(page, example);
    await page.locator("#label-right", { hasText: `· ${number(4 * PART_FACES)} faces` }).waitFor();
    release();
    const download = await coming;
    assert.equal(download.suggestedFilename(), "tetrahedron-refined.obj");
    const pieces = [];
    for await (const piece of await download.createReadStream()) pieces.push(piece);
    const query = "levels=1&uv=linear&crease=auto&format=obj";
    same(Buffer.concat(pieces), await refined(query, TETRAHEDRON.buffer, "model/obj"));
  });
});

describe("jobs of the page", { skip: noBrowser, timeout: 1_800_000 }, () => {
  const { visit } = studio();

  test("the comparison comes although a heat map asks for more", async () => {
    const page = await visit({ hash: "#levels=1&look=ratio" });
    await choose(page, example);
    await settled(page);
    await page.locator("#legend", { hasText: "Share of the bound used" }).waitFor();
    await page.selectOption("#look", "distance");
    await page.locator("#legend", { hasText: "Distance to classic" }).waitFor();
    await page.selectOption("#pair", "loop");
    assert.match(await page.textContent("#label-left"), /^Classic/);
  });

  test("the comparison comes after all where a refused file ended it", async () => {
    const page = await visit({ hash: "#levels=1&look=distance", expected: [422] });
    const release = await hold(page, (body, url) => /scheme=loop/.test(url) && body?.equals(TETRAHEDRON.buffer));
    await choose(page, TETRAHEDRON);
    await page.locator("#work-text", { hasText: "for comparison" }).waitFor();
    await choose(page, { ...example, name: "nan.glb", buffer: broken(part) });
    await page.click("#problem-close");
    release();
    await page.locator("#legend", { hasText: "Distance to classic" }).waitFor();
    await settled(page);
    assert.equal(await page.textContent("#file-name"), "tetrahedron.obj");
  });

  test("a comparison that is cancelled stays so", async () => {
    const page = await visit({ hash: "#levels=1&look=distance" });
    await hold(page, (_, url) => /scheme=loop/.test(url));
    await choose(page, TETRAHEDRON);
    await page.locator("#work-text", { hasText: "for comparison" }).waitFor();
    await page.click("#cancel");
    await page.waitForTimeout(500);
    assert.ok(await page.isHidden("#work"));
  });

  test("settings that change before the first result count", async () => {
    const page = await visit({ hash: "#levels=1" });
    const release = await hold(page, (_, url) => /levels=1/.test(url));
    await choose(page, example);
    await page.locator("#levels", { hasText: number(4 * PART_FACES) }).waitFor({ state: "attached" });
    await page.selectOption("#levels", "2");
    await settledWith(page, 16 * PART_FACES);
    release();
  });

  test("other settings that are cancelled leave the form to what is shown, and can be asked for again", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, TETRAHEDRON);
    await settled(page);
    const release = await hold(page);
    const sent = page.waitForRequest(/levels=3/);
    await page.selectOption("#levels", "3");
    await sent;
    await page.click("#cancel");
    assert.equal(await page.inputValue("#levels"), "1");
    release();
    await page.click("#again");
    await settledWith(page, 4 * 64);
    assert.equal(await page.inputValue("#levels"), "3");
  });

  test("other settings that are refused, or do not arrive, leave the form to what is shown", async () => {
    const page = await visit({ hash: "#levels=1", expected: [422], foreseen: /ERR_FAILED/ });
    await choose(page, example);
    await settled(page);
    const refusal = { title: "A parameter is out of range", detail: "No.", parameter: "budget", status: 422 };
    await page.route(/\/subdivide\?/, (route) => route.fulfill({ status: 422, json: refusal }));
    await page.click("#research summary");
    await page.fill("#strength", "150");
    await page.locator("#problem-pointer", { hasText: "budget" }).waitFor();
    assert.equal(await page.inputValue("#strength"), "100");
    assert.ok(!(await page.evaluate(() => location.hash)).includes("budget"));
    await page.unroute(/\/subdivide\?/);
    await page.route(/\/subdivide\?/, (route) => route.abort());
    await page.selectOption("#levels", "2");
    await page.locator("#problem-again").waitFor();
    assert.equal(await page.inputValue("#levels"), "1");
    await page.unroute(/\/subdivide\?/);
    await page.click("#problem-again");
    await settledWith(page, 16 * PART_FACES);
    assert.equal(await page.inputValue("#levels"), "2");
  });

  test("a file that is cancelled while its answer is read stays unrefined", async () => {
    const page = await visit({ hash: "#levels=1" });
    let release, arrive;
    const released = new Promise((resolve) => (release = resolve));
    const arrived = new Promise((resolve) => (arrive = resolve));
    const late = async (route) => {
      const response = await route.fetch();
      arrive();
      await released;
      await route.fulfill({ response }).catch(() => {});
    };
    await page.route(/\/subdivide\?/, late, { times: 1 });
    await choose(page, example);
    await arrived;
    await page.click("#cancel");
    release();
    await page.waitForTimeout(1000);
    assert.ok(await page.isHidden("#label-right"));
    await page.click("#again");
    await settledWith(page, 4 * PART_FACES);
  });

  test("a file that is chosen before the limits are known gives way to the next", async () => {
    const page = await visit();
    let know;
    const known = new Promise((resolve) => (know = resolve));
    await page.route(/\/limits$/, async (route) => {
      await known;
      await route.continue();
    });
    await page.reload();
    await page.evaluate(() => {
      window.names = new Set();
      const name = document.querySelector("#file-name");
      new MutationObserver(() => window.names.add(name.textContent)).observe(name, { childList: true });
    });
    await choose(page, TETRAHEDRON);
    await page.waitForTimeout(500);
    await choose(page, example);
    await page.waitForTimeout(500);
    know();
    await settledWith(page, 16 * PART_FACES);
    const names = await page.evaluate(() => [...window.names]);
    assert.deepEqual(names.filter(Boolean), [example.name]);
  });

  for (const [what, body] of Object.entries(UNSHOWABLE)) {
    test(`${what} that cannot be shown is no fault of the file, and can be tried again`, async () => {
      const page = await visit({ hash: "#levels=1" });
      await page.route(/\/subdivide\?/, (route) => route.fulfill(mixed(body)));
      await choose(page, example);
      await page.locator("#problem-title", { hasText: "The result cannot be shown" }).waitFor();
      assert.match(await page.textContent("#label-left"), new RegExp(`${number(PART_FACES)} faces`));
      await page.unroute(/\/subdivide\?/);
      await page.click("#problem-again");
      await settledWith(page, 4 * PART_FACES);
    });
  }

  test("another try at a download that failed is that download", async () => {
    const page = await visit({ hash: "#levels=1", foreseen: /ERR_FAILED/ });
    await choose(page, example);
    await settled(page);
    await page.selectOption("#format", "stl");
    await page.route(/\/subdivide\?/, (route) => route.abort());
    await page.click("#download");
    await page.locator("#problem").waitFor();
    await page.unroute(/\/subdivide\?/);
    const { name } = await downloaded(page, "#problem-again");
    assert.equal(name, "part-refined.stl");
  });

  for (const [what, fulfil] of Object.entries({
    "is refused": (route) => route.abort(),
    "ends before its last boundary": (route) => route.fulfill({ ...mixed(part), body: mixed(part).body.subarray(0, -6) }),
  })) {
    test(`a connection that ${what} is tried once more, and that is said`, async () => {
      const page = await visit({ hash: "#levels=1", foreseen: /ERR_FAILED/ });
      const said = page.locator("#work-text", { hasText: "The connection broke, trying once more" }).waitFor();
      await page.route(/\/subdivide\?/, fulfil, { times: 1 });
      await choose(page, example);
      await said;
      await settledWith(page, 4 * PART_FACES);
      assert.ok(await page.isHidden("#problem"));
    });
  }

  test("a connection that breaks twice is a problem, and can be tried again", async () => {
    const page = await visit({ hash: "#levels=1", foreseen: /ERR_FAILED/ });
    await page.route(/\/subdivide\?/, (route) => route.abort(), { times: 2 });
    await choose(page, example);
    await page.locator("#problem-title", { hasText: "The connection broke twice" }).waitFor();
    await page.click("#problem-again");
    await settledWith(page, 4 * PART_FACES);
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
    await page.selectOption("#format", "ply");
    await page.click("#download");
    await page.click("#cancel");
    assert.ok(await page.isHidden("#work"));
    assert.ok(await page.isHidden("#notice"));
  });
});

describe("a file that is too large", { skip: noBrowser, timeout: 900_000 }, () => {
  const { visit } = studio({ PNS_BODY: "20kB" });

  test("is not said to be opened, and leaves the list to what is shown", async () => {
    const page = await visit({ hash: "#levels=1" });
    await page.locator("#limits", { hasText: "up to" }).waitFor();
    await choose(page, TETRAHEDRON, example);
    await page.locator("#problem", { hasText: "too large" }).waitFor();
    assert.equal(await page.textContent("#notice-text"), "The list at the top has tetrahedron.obj.");
    await page.selectOption("#file", { label: "tetrahedron.obj (2 of 2)" });
    await settled(page);
    await page.selectOption("#file", { label: "part.glb (1 of 2)" });
    await page.locator("#problem", { hasText: "too large" }).waitFor();
    assert.equal(await page.inputValue("#file"), "1");
  });
});

/** The same file, whose first accessor promises more than there is. */
function endless(bytes) {
  const { json, bin } = read(bytes);
  json.accessors[0].count = 10 ** 7;
  json.asset.extras = { pns: {} };
  return write({ json, bin });
}

/** A whole stream with a file. */
function mixed(bytes) {
  const head = `--b\r\nContent-Description: file\r\nContent-Length: ${bytes.length}\r\n\r\n`;
  const body = Buffer.concat([Buffer.from(head), bytes, Buffer.from("\r\n--b--\r\n")]);
  return { contentType: "multipart/mixed; boundary=b", body };
}

async function settledWith(page, faces) {
  await page.locator("#label-right", { hasText: `· ${number(faces)} faces` }).waitFor();
  await settled(page);
}
