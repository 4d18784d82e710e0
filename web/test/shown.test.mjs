/** What is shown, and what is on its way: neither is taken for the other. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import { choose, downloaded, hold, noBrowser, picture, settled } from "./support/browser.mjs";
import { broken, read, write } from "./support/glb.mjs";
import { example, number, part, PART_FACES, same, studio, TETRAHEDRON } from "./support/studio.mjs";

// One level of the example, five of the tetrahedron.
const FEW = { PNS_FACES: "20000" };
const DEEP = "#levels=4";
/** How the page asks for the tetrahedron. */
const SMOOTH = "uv=linear&crease=auto&normals=smooth";

const UNSHOWABLE = { "a cut answer": part.subarray(0, 64), "an answer": endless(part) };

describe("what is shown", { skip: noBrowser, timeout: 900_000 }, () => {
  const { visit, refined } = studio(FEW);

  /** A page that shows the tetrahedron after four levels. */
  async function deep() {
    const page = await visit({ hash: DEEP });
    await choose(page, TETRAHEDRON);
    await settled(page);
    return page;
  }

  test("has its own settings again, once a second file is cancelled", async () => {
    const page = await deep();
    await hold(page);
    await choose(page, example);
    await closed(page);
    // Into the address of the page, too.
    await page.check("#edges");
    await page.click("#cancel");
    assert.equal(await page.inputValue("#levels"), "4");
    assert.match(await page.evaluate(() => location.hash), /levels=4/);
  });

  test("is downloaded with the settings that made it", async () => {
    const page = await deep();
    const release = await hold(page, (body) => body?.equals(part));
    await choose(page, example);
    await closed(page);
    await page.check("#attributes");
    const { bytes } = await downloaded(page, "#download");
    same(bytes, await refined(`levels=4&${SMOOTH}&diagnostics=full`, TETRAHEDRON.buffer, "model/obj"));
    release();
    await settled(page);
  });

  test("has heat maps of its own values", async () => {
    const page = await deep();
    const release = await hold(page, (body) => body?.equals(part));
    await choose(page, example);
    await closed(page);
    const asked = page.waitForRequest(/diagnostics=full/);
    await page.selectOption("#look", "ratio");
    assert.match((await asked).url(), /levels=4/);
    await page.locator("#legend", { hasText: "Share of the budget" }).waitFor();
    release();
    await settled(page);
  });

  test("keeps its lines where another file is refused", async () => {
    const page = await visit({ hash: `${DEEP}&layout=side&look=wire`, expected: [422] });
    await choose(page, TETRAHEDRON);
    await settled(page);
    const { data } = await picture(page);
    await choose(page, { ...example, buffer: broken(part) });
    await page.locator("#problem").waitFor();
    same((await picture(page)).data, data);
  });

  test("has its download and its heat map although another file comes", async () => {
    const page = await visit({ hash: DEEP, expected: [422] });
    await choose(page, TETRAHEDRON);
    await settled(page);
    const release = await hold(page, (_, url) => url.includes("diagnostics=full"));
    await page.selectOption("#look", "gate");
    await choose(page, { ...example, buffer: broken(part) });
    await page.locator("#problem").waitFor();
    release();
    await page.locator("#legend", { hasText: "Gate" }).waitFor();
    await page.locator("#work").waitFor({ state: "hidden" });
    await page.selectOption("#look", "material");
    const later = await hold(page, (_, url) => url.includes("diagnostics=full"));
    await page.check("#attributes");
    const coming = page.waitForEvent("download");
    await page.click("#download");
    await choose(page, example);
    await page.locator("#label-right", { hasText: `${number(4 * PART_FACES)} faces` }).waitFor();
    later();
    assert.equal((await coming).suggestedFilename(), "tetrahedron-refined.glb");
    await settled(page);
  });

  test("does not take levels from the files after it", async () => {
    const page = await visit({ hash: DEEP });
    await choose(page, example, TETRAHEDRON);
    await settled(page);
    for (const [number, levels] of [[1, "4"], [0, "1"], [1, "4"]]) {
      await page.selectOption("#file", String(number));
      await page.waitForFunction((levels) => document.querySelector("#levels").value === levels, levels);
      await settled(page);
    }
  });
});

describe("what is on its way", { skip: noBrowser, timeout: 900_000 }, () => {
  const { visit, refined } = studio();

  /** A page that shows the tetrahedron after one level, while the example waits with two chosen for it. */
  async function twice(options = {}) {
    const page = await visit({ hash: "#levels=1", ...options });
    await choose(page, TETRAHEDRON);
    await settled(page);
    const release = await hold(page, (body) => body?.equals(part));
    await choose(page, example);
    await page.locator("#levels", { hasText: number(4 * PART_FACES) }).waitFor({ state: "attached" });
    const sent = page.waitForRequest(/levels=2/);
    await page.selectOption("#levels", "2");
    await sent;
    return { page, release };
  }

  test("is refined with its own settings, once it is asked for again", async () => {
    const { page, release } = await twice();
    await page.click("#cancel");
    assert.equal(await page.inputValue("#levels"), "1");
    release();
    await page.click("#again");
    await settledWith(page, 16 * PART_FACES);
    assert.equal(await page.inputValue("#levels"), "2");
  });

  test("is tried again with its own settings", async () => {
    const { page, release } = await twice({ foreseen: /ERR_FAILED/ });
    await page.route(/\/jobs\/.*events/, (route) => route.abort());
    release();
    await page.locator("#problem").waitFor();
    assert.equal(await page.inputValue("#levels"), "1");
    await page.unroute(/\/jobs\/.*events/);
    await page.click("#problem-again");
    await settledWith(page, 16 * PART_FACES);
    assert.equal(await page.inputValue("#levels"), "2");
  });

  test("is what the list names, once it is asked for again", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, example, TETRAHEDRON);
    await settled(page);
    const release = await hold(page);
    const sent = page.waitForRequest(/jobs/);
    await page.selectOption("#file", "1");
    await sent;
    await page.click("#cancel");
    assert.equal(await page.inputValue("#file"), "0");
    const again = page.waitForRequest(/jobs/);
    await page.click("#again");
    await again;
    assert.equal(await page.inputValue("#file"), "1");
    release();
    await settledWith(page, 16);
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
    await page.route(/\/jobs\?/, (route) => route.fulfill({ status: 422, json: refusal }));
    await page.fill("#budget", "77");
    await page.locator("#problem-pointer", { hasText: "budget" }).waitFor();
    assert.equal(await page.inputValue("#budget"), "");
    assert.ok(!(await page.evaluate(() => location.hash)).includes("budget"));
    await page.unroute(/\/jobs\?/);
    await page.route(/\/jobs\?/, (route) => route.abort());
    await page.selectOption("#levels", "2");
    await page.locator("#problem-again").waitFor();
    assert.equal(await page.inputValue("#levels"), "1");
    await page.unroute(/\/jobs\?/);
    await page.click("#problem-again");
    await page.locator("#label-right", { hasText: number(16 * PART_FACES) }).waitFor();
    assert.equal(await page.inputValue("#levels"), "2");
  });

  test("normals as in the file, chosen on its way, stay", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, example);
    await settled(page);
    const release = await hold(page, (body) => body?.equals(TETRAHEDRON.buffer));
    await choose(page, TETRAHEDRON);
    await page.waitForFunction(() => document.querySelector("#normals").value === "smooth");
    const anew = page.waitForRequest((request) => request.method() === "POST" && !/normals/.test(request.url()));
    await page.selectOption("#normals", "keep", { force: true });
    await anew;
    release();
    await settledWith(page, 16);
    assert.equal(await page.inputValue("#normals"), "keep");
  });

  test("is timed from where it was asked for, whatever is refused meanwhile", async () => {
    const { page, release } = await twice();
    await page.waitForTimeout(2000);
    await choose(page, { name: "a.txt", mimeType: "", buffer: Buffer.from("") });
    await page.locator("#problem").waitFor();
    release();
    await settledWith(page, 16 * PART_FACES);
    const time = await page.textContent("#timings tr:has-text('From request') td");
    assert.ok(parseFloat(time) >= 2 && /\u00a0s$/.test(time), time);
  });

  test("stays ended where it is cancelled while its answer is read", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, TETRAHEDRON);
    await settled(page);
    await page.evaluate(() => {
      const { arrayBuffer } = Blob.prototype;
      const released = new Promise((resolve) => (window.release = resolve));
      Blob.prototype.arrayBuffer = async function () {
        // An answer, and no file of the user's.
        if (!(this instanceof File)) {
          window.reading = true;
          await released;
        }
        return arrayBuffer.call(this);
      };
    });
    await choose(page, example);
    await page.waitForFunction(() => window.reading);
    await page.click("#cancel");
    await page.evaluate(() => window.release());
    await page.waitForTimeout(1000);
    assert.equal(await page.textContent("#file-name"), TETRAHEDRON.name);
    assert.equal(await page.textContent("#notice-text"), "part.glb: cancelled");
    assert.match(await page.textContent("#label-left"), /\D4 faces/);
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
    await page.locator("#work-text", { hasText: "Opening the file" }).waitFor({ timeout: 20_000 });
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
      await page.route(/\/result$/, (route) => route.fulfill({ contentType: "model/gltf-binary", body }));
      await choose(page, example);
      await told(page, /^The result cannot be shown/);
      assert.match(await page.textContent("#label-left"), new RegExp(`${number(PART_FACES)} faces`));
      await page.unroute(/\/result$/);
      await page.click("#problem-again");
      await settledWith(page, 4 * PART_FACES);
      // The second file's leaves the first.
      await page.route(/\/result$/, (route) => route.fulfill({ contentType: "model/gltf-binary", body }));
      await choose(page, TETRAHEDRON);
      await told(page, /^The result cannot be shown/);
      assert.equal(await page.textContent("#file-name"), example.name);
      assert.match(await page.textContent("#label-right"), new RegExp(`· ${number(4 * PART_FACES)} faces`));
      await page.selectOption("#look", "gate");
      await told(page, /^The heat map cannot be shown/);
      await page.unroute(/\/result$/);
      await page.click("#problem-again");
      await page.locator("#legend", { hasText: "Gate" }).waitFor();
    });
  }

  test("an example that comes late gives way to what was chosen after it", async () => {
    const page = await visit({ hash: "#levels=1" });
    let release;
    const released = new Promise((resolve) => (release = resolve));
    await page.route(/example/, async (route) => {
      await released;
      await route.continue();
    });
    await page.click("#example");
    await choose(page, TETRAHEDRON);
    await settled(page);
    const come = page.waitForResponse(/example/);
    release();
    await come;
    await page.waitForTimeout(1000);
    await settled(page);
    assert.equal(await page.textContent("#file-name"), TETRAHEDRON.name);
  });

  test("an example that does not come is tried again", async () => {
    const page = await visit({ hash: "#levels=1", foreseen: /ERR_FAILED/ });
    await page.route(/example/, (route) => route.abort());
    await page.click("#example");
    await page.locator("#problem").waitFor();
    await page.unroute(/example/);
    await page.click("#problem-again");
    await page.locator("#file-name", { hasText: "example.glb" }).waitFor({ timeout: 20_000 });
    await settled(page);
  });

  test("another try at a download is of the file that it was of", async () => {
    const { page, release } = await twice({ foreseen: /ERR_FAILED/ });
    await page.check("#attributes");
    await page.route(/diagnostics=full/, (route) => route.abort());
    await page.click("#download");
    await page.locator("#problem").waitFor();
    await page.unroute(/diagnostics=full/);
    release();
    await settledWith(page, 16 * PART_FACES);
    const { name, bytes } = await downloaded(page, "#problem-again");
    assert.equal(name, "tetrahedron-refined.glb");
    same(bytes, await refined(`levels=1&${SMOOTH}&diagnostics=full`, TETRAHEDRON.buffer, "model/obj"));
  });
});

describe("what is too large", { skip: noBrowser, timeout: 900_000 }, () => {
  const { visit } = studio({ PNS_BODY: "20kB" });

  test("is not said to be opened, and leaves the list to what is on its way", async () => {
    const page = await visit({ hash: "#levels=1" });
    await page.locator("#limits", { hasText: "up to" }).waitFor();
    const other = { ...TETRAHEDRON, name: "other.obj" };
    await choose(page, TETRAHEDRON, example, other);
    await page.locator("#problem", { hasText: "too large" }).waitFor();
    assert.equal(await page.textContent("#notice-text"), "The list at the top has tetrahedron.obj, other.obj.");
    await page.selectOption("#file", { label: "tetrahedron.obj (2 of 3)" });
    await settled(page);
    const release = await hold(page);
    const sent = page.waitForRequest(/jobs/);
    await page.selectOption("#file", { label: "other.obj (3 of 3)" });
    await sent;
    await page.selectOption("#file", { label: "part.glb (1 of 3)" });
    await page.locator("#problem", { hasText: "too large" }).waitFor();
    assert.equal(await page.inputValue("#file"), "2");
    release();
    await settled(page);
  });
});

async function told(page, words) {
  await page.locator("#problem-title", { hasText: words }).waitFor();
  assert.ok(await page.isVisible("#problem-again"));
}

/** The same file, whose first accessor says more than there is. */
function endless(bytes) {
  const { json, bin } = read(bytes);
  json.accessors[0].count = 10 ** 7;
  json.asset.extras = { pns: {} };
  return write({ json, bin });
}

/** The form is the example's: four levels of it are too many. */
async function closed(page) {
  await page.waitForFunction(() => document.querySelector("#levels").value === "1");
}

async function settledWith(page, faces) {
  await page.locator("#label-right", { hasText: `· ${number(faces)} faces` }).waitFor({ timeout: 20_000 });
  await settled(page);
}
