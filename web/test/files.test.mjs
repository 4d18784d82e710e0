/** The kinds of file that the page opens, and the files that come beside them. */

import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { mkdtemp, readdir, rm, utimes, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { basename, dirname, join } from "node:path";
import { describe, test } from "node:test";
import { fileURLToPath } from "node:url";
import { zipSync } from "three/addons/libs/fflate.module.js";
import { choose, downloaded, noBrowser, settled } from "./support/browser.mjs";
import { bare, broken, moving, read, write } from "./support/glb.mjs";
import { example, number, part, PART_FACES, studio } from "./support/studio.mjs";

const FIXTURES = fileURLToPath(new URL("../../../shared/assets/fixtures/", import.meta.url));
const TRIANGLE = {
  name: "triangle.obj",
  mimeType: "",
  buffer: Buffer.from("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
};
const REFUSED = [
  ["BoxWithInfinites.glb", /NaN or infinity/],
  ["IndexOutOfRange.gltf", /index 255, but there are 24 vertices/],
  ["empty_nodes.glb", /no triangles/],
];

describe("files on the page", { skip: noBrowser, timeout: 1_800_000 }, () => {
  const { visit, refined, refusal } = studio();

  test("a glTF of positions alone is shown, and comes back smooth", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, { name: "bare.gltf", mimeType: "", buffer: Buffer.from(JSON.stringify(bare())) });
    await settled(page);
    assert.match(await page.textContent("#label-left"), /\D4 faces/);
    assert.match(await page.textContent("#label-right"), /· 16 faces/);
    // What a file lacks does not change what the user wants.
    assert.equal(await page.inputValue("#normals"), "auto");
    await page.check("#edges");
    assert.ok(!(await page.evaluate(() => location.hash)).includes("normals"));
  });

  test("each file of a collection is refined, or refused in words", { skip: !existsSync(FIXTURES) && `needs ${FIXTURES}` }, async () => {
    // What three.js says of files that are broken, or hold what it leaves out, is as it should be.
    const page = await visit({ hash: "#levels=1", expected: [422], foreseen: /Missing min\/max|Unknown extension/ });
    const names = await readdir(FIXTURES, { recursive: true });
    const documents = names.filter((name) => /\.(glb|gltf)$/.test(name)).sort();
    assert.ok(documents.length > 10);
    for (const name of documents) {
      const beside = name.includes("/") ? await neighbours(name) : [];
      await page.evaluate(() => {
        document.body.classList.remove("refined");
        document.querySelector("#problem").hidden = true;
      });
      await choose(page, join(FIXTURES, name), ...beside);
      await page.waitForFunction(
        () =>
          document.querySelector("#work").hidden &&
          (document.body.classList.contains("refined") || !document.querySelector("#problem").hidden),
      );
      const refused = REFUSED.find(([file]) => name.endsWith(file));
      if (refused) {
        assert.match(await page.textContent("#problem-detail"), refused[1], name);
        continue;
      }
      assert.ok(await page.isHidden("#problem"), `${name}: ${await page.textContent("#problem-detail")}`);
      const [before, after] = await Promise.all(
        ["#label-left", "#label-right"].map(async (id) => facesIn(await page.textContent(id))),
      );
      assert.ok(before > 0, name);
      assert.equal(after, 4 * before, name);
    }
  });

  test("an OBJ of polygons stays one, in its counts, its words and its download", async () => {
    const page = await visit({ hash: "#levels=1" });
    const text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nusemtl red\nf 1/1 2//1 3 4 # a square\nf -5 \\\n-4 5\n";
    await choose(page, { name: "a.obj", mimeType: "", buffer: Buffer.from(text) });
    await settled(page);
    // A square and a triangle; a quad for each of their corners.
    assert.match(await page.textContent("#label-left"), /\D2 faces/);
    assert.match(await page.textContent("#label-right"), /· 7 faces/);
    assert.match(await page.textContent("#levels option:checked"), /· 7 faces/);
    assert.doesNotMatch(await page.textContent("#changes"), /polygons/);
    assert.equal(await page.textContent("#statistics tr:has-text('Vertices in the file') td"), "5");
    assert.match(await page.textContent("#mathematics"), /Catmull–Clark’s.*Measured between the refined vertices/);
    const { bytes } = await downloaded(page, "#download");
    const corners = [...String(bytes).matchAll(/^f (.+)$/gm)].map(([, face]) => face.trim().split(/\s+/).length);
    assert.deepEqual(corners, Array(7).fill(4));
  });

  test("files are shown as the service reads them", async () => {
    const page = await visit({ hash: "#levels=1" });
    const corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\n";
    const words = (...values) => Buffer.concat(values.map((value) => {
      const word = Buffer.alloc(4);
      return word.writeInt32BE(value) && word;
    }));
    const floats = Buffer.alloc(36);
    [0, 0, 0, 1, 0, 0, 0, 1, 0].forEach((value, at) => floats.writeFloatBE(value, 4 * at));
    for (const [name, file, faces, vertices] of [
      ["continued.obj", `${corners}f 1 2 \\ \n3 4\nf 1 2 5\n`, 2, "5"],
      ["old.obj", `${corners}usemtl a#1\nfo 1 2 3\nf 1 2 5\n`.replaceAll("\n", "\r"), 2, "5"],
      ["wide.obj", Buffer.from(`\ufeff${corners}f 1 2 3\nf 1 2 5\n`, "utf16le"), 2, "5"],
      ["partly.obj", `${corners}vt 0 0\nvt 1 0\nvt 1 1\nf 1/1 2/2 3/3\nf 1 2 5\n`, 2, "6"],
      ["binary.off", Buffer.concat([Buffer.from("OFF BINARY\n"), words(3, 1, 0), floats, words(3, 0, 1, 2, 0)]), 1, "3"],
      ["glued.off", "OFF3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", 1, "3"],
    ]) {
      await choose(page, { name, mimeType: "", buffer: Buffer.from(file) });
      await page.locator("#file-name", { hasText: name }).waitFor();
      await settled(page);
      assert.match(await page.textContent("#label-left"), new RegExp(`Before${faces} face`), name);
      const before = await page.textContent("#statistics tr:has-text('Vertices in the file') td");
      assert.equal(before, vertices, name);
      assert.ok(await page.isHidden("#problem"), name);
    }
  });

  test("a broken file gets words, and the model that was there stays", async () => {
    const page = await visit({ hash: "#levels=1", expected: [422] });
    await choose(page, example);
    await settled(page);
    const label = await page.textContent("#label-right");
    await choose(page, { name: "broken.glb", mimeType: "", buffer: broken(part) });
    await page.locator("#problem").waitFor();
    assert.equal(await page.textContent("#problem-title"), "The glTF breaks its own promises");
    assert.match(await page.textContent("#problem-detail"), /NaN/);
    assert.match(await page.textContent("#problem-pointer"), /^in broken\.glb, at \/accessors\/\d/);
    assert.equal(await page.textContent("#label-right"), label);
    assert.equal(await page.textContent("#file-name"), "part.glb");
    await choose(page, { name: "text.txt", mimeType: "", buffer: Buffer.from("hello") });
    assert.match(await page.textContent("#problem-title"), /^Format not supported$/);
  });

  const zipped = Buffer.from(zipSync({ "a.obj": Buffer.from("v 0 0 0") }));
  for (const [name, buffer, words] of [
    ["empty.glb", Buffer.alloc(0), /^The file is empty/],
    ["mesh.zip", zipped, /^No glTF in this archive.*a\.obj/],
    ["text.txt", Buffer.from("hello"), /^Format not supported/],
  ]) {
    test(`${name} gets words of the page, and no other try`, async () => {
      const page = await visit();
      await choose(page, { name, mimeType: "", buffer });
      await page.locator("#problem").waitFor();
      assert.match((await page.textContent("#problem")).trim().replace(/\s+/g, " "), words);
      assert.ok(await page.isHidden("#problem-again"));
    });
  }

  for (const [name, buffer, type] of [
    ["cut.glb", part.subarray(0, 9000), "model/gltf-binary"],
    ["text.glb", Buffer.from("hello"), "model/gltf-binary"],
    ["null.gltf", Buffer.from("null"), "model/gltf+json"],
    ["half.gltf", Buffer.from('{"asset":{"version":"2.0"},"meshes":[{}]}'), "model/gltf+json"],
    ["text.zip", Buffer.from("hello"), "application/zip"],
    ["other.stl", part, "model/stl"],
    ["nan.glb", broken(part), "model/gltf-binary"],
  ]) {
    test(`${name}, which the page cannot read, gets the service's own words`, async () => {
      const page = await visit({ expected: [400, 422] });
      await choose(page, { name, mimeType: "", buffer });
      await page.locator("#problem").waitFor();
      const { title, detail } = await refusal("levels=1&scheme=loop", buffer, type);
      assert.equal(await page.textContent("#problem-title"), title);
      // As a sentence.
      const said = `${detail[0].toUpperCase()}${detail.slice(1)}.`;
      assert.equal(await page.textContent("#problem-detail"), said);
      assert.ok(await page.isHidden("#problem-again"));
      assert.ok(await page.isVisible("#welcome"));
    });
  }

  test("a file that was written anew since it was chosen is called that, at work and where it waits", async () => {
    const folder = await mkdtemp(join(tmpdir(), "pns-page-"));
    const paths = ["a.glb", "b.glb"].map((name) => join(folder, name));
    try {
      for (const path of paths) await writeFile(path, part);
      const page = await visit({ hash: "#levels=1", foreseen: /ERR_UPLOAD_FILE_CHANGED/ });
      await page.setInputFiles("#files", paths);
      await settled(page);
      for (const path of paths) await utimes(path, 1, 1);
      await page.selectOption("#levels", "2");
      await page.locator("#problem-title", { hasText: "The file has changed" }).waitFor();
      assert.ok(await page.isHidden("#problem-again"));
      await page.click("#problem-close");
      await page.selectOption("#file", "1");
      await page.locator("#problem").waitFor();
      assert.equal(await page.textContent("#problem-title"), "The file has changed");
      assert.equal(await page.inputValue("#file"), "0");
    } finally {
      await rm(folder, { recursive: true });
    }
  });

  test("of several meshes one is opened, the others are a choice away, and what is left is named", async () => {
    const page = await visit({ hash: "#levels=1" });
    const notes = { name: "notes.txt", mimeType: "", buffer: Buffer.from("hello") };
    await choose(page, TRIANGLE, notes, example);
    await settled(page);
    assert.match(await page.textContent("#label-left"), new RegExp(number(PART_FACES)));
    assert.match(await page.textContent("#notice-text"), /part\.glb is opened.* triangle\.obj too.*Not used: notes\.txt/);
    assert.deepEqual(await namesListed(page), ["part.glb (1 of 2)", "triangle.obj (2 of 2)"]);
    await page.selectOption("#file", "1");
    await page.locator("#label-left", { hasText: "1 face" }).waitFor();
    await settled(page);
    assert.ok(await page.isHidden("#notice"));
    assert.equal(await page.inputValue("#file"), "1");
    await choose(page, example);
    await page.locator("#file-name", { hasText: "part.glb" }).waitFor();
    assert.ok(await page.isHidden("#file"));
  });

  test("where the first of several meshes is broken the others can be chosen", async () => {
    const page = await visit({ hash: "#levels=1", expected: [422] });
    await choose(page, { name: "broken.glb", mimeType: "", buffer: broken(part) }, TRIANGLE);
    await page.locator("#problem").waitFor();
    await page.selectOption("#file", "1");
    await settled(page);
    assert.match(await page.textContent("#label-left"), /\D1 face$/);
    assert.ok(await page.isHidden("#problem"));
  });

  test("of the files beside two documents each gets its own", async () => {
    const page = await visit({ hash: "#levels=1" });
    await page.evaluate(() => {
      window.sent = new Set();
      const { append } = FormData.prototype;
      FormData.prototype.append = function (name, file, path) {
        window.sent.add(`${name}: ${path}`);
        append.call(this, name, file, path);
      };
    });
    const files = ["a", "b"].flatMap((name) => {
      const { buffers, ...document } = bare();
      const [{ byteLength, uri }] = buffers;
      const json = { ...document, buffers: [{ byteLength, uri: `./${name}.bin` }] };
      const bin = Buffer.from(uri.slice(uri.indexOf(",") + 1), "base64");
      return [
        { name: `${name}.gltf`, mimeType: "", buffer: Buffer.from(JSON.stringify(json)) },
        { name: `${name}.bin`, mimeType: "", buffer: bin },
      ];
    });
    await choose(page, ...files);
    await settled(page);
    assert.doesNotMatch(await page.textContent("#notice-text"), /Not used/);
    assert.deepEqual(await page.evaluate(() => [...window.sent]), ["file: a.gltf", "a.bin: a.bin"]);
  });

  const { buffers: [{ uri: data }], ...document } = bare();
  const bin = Buffer.from(data.slice(data.indexOf(",") + 1), "base64");
  const naming = (uri) => Buffer.from(JSON.stringify({ ...document, buffers: [{ byteLength: bin.length, uri }] }));
  const apart = "käse.bin".normalize("NFD");
  for (const [how, files] of Object.entries({
    "by a path out of its folder": { "scenes/a.gltf": naming("../data/a.bin"), "data/a.bin": bin },
    "in an archive of PowerShell’s": { "m\\a.gltf": naming("t/a.bin"), "m\\t\\a.bin": bin },
    "by a path that goes up on its way": { "a.gltf": naming("./t/../a.bin"), "a.bin": bin },
    "by a path of Windows’": { "a.gltf": naming("t\\a.bin"), "t/a.bin": bin },
    "with accents apart": { "a.gltf": naming("käse.bin"), [apart]: bin },
    "with accents together": { "a.gltf": naming(apart), "käse.bin": bin },
  })) {
    test(`a file in a .zip is found ${how}`, async () => {
      const page = await visit({ hash: "#levels=1" });
      await choose(page, { name: "a.zip", mimeType: "", buffer: Buffer.from(zipSync(files)) });
      await page.locator("body.refined, #problem:not([hidden])").first().waitFor();
      assert.equal(await page.textContent("#problem-detail"), "");
      await settled(page);
      assert.match(await page.textContent("#validation-text"), /Input: (?!.*error)/);
    });
  }

  test("a file beside a document is found with accents apart, as macOS hands it over", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, { name: "a.gltf", mimeType: "", buffer: naming("k%C3%A4se.bin") }, { name: apart, mimeType: "", buffer: bin });
    await page.locator("body.refined, #problem:not([hidden])").first().waitFor();
    assert.equal(await page.textContent("#problem-detail"), "");
    await settled(page);
  });

  test("a texture that did not come with its document is named", async () => {
    const page = await visit({ hash: "#levels=1", foreseen: /Couldn't load texture/ });
    const json = { ...bare(), images: [{ uri: "wood.png" }], textures: [{ source: 0 }] };
    json.materials = [{ pbrMetallicRoughness: { baseColorTexture: { index: 0 } } }];
    json.meshes[0].primitives[0].material = 0;
    await choose(page, { name: "a.gltf", mimeType: "", buffer: Buffer.from(JSON.stringify(json)) }, TRIANGLE);
    await settled(page);
    assert.match(await page.textContent("#notice-text"), /triangle\.obj too\. a\.gltf names what is not among the files: wood\.png\./);
  });

  test("of a first file that cannot be drawn and is refused the form keeps no faces", async () => {
    const page = await visit({ expected: [422] });
    await page.locator("#limits:not(:empty)").waitFor();
    const levels = await page.textContent("#levels");
    await choose(page, { ...example, name: "nan.glb", buffer: broken(part) });
    await page.locator("#problem").waitFor();
    assert.ok(await page.isVisible("#welcome"));
    assert.equal(await page.textContent("#levels"), levels);
  });

  test("of a first file that is refused nothing stays", async () => {
    const page = await visit({ expected: [422] });
    const levels = await page.textContent("#levels");
    const { json, bin } = read(part);
    json.accessors[json.meshes[0].primitives[0].indices].count = 2;
    json.meshes[0].primitives[0].targets = [{ POSITION: json.meshes[0].primitives[0].attributes.POSITION }];
    await choose(page, { name: "short.glb", mimeType: "", buffer: moving(write({ json, bin }), 1) });
    await page.locator("#problem").waitFor();
    assert.ok(await page.isVisible("#welcome"));
    for (const part of ["#label-left", "#timeline", "#morphs"]) assert.ok(await page.isHidden(part), part);
    assert.equal(await page.textContent("#levels"), levels);
  });

  test("a long name pushes nothing out of the window", async () => {
    const page = await visit({ hash: "#levels=1" });
    const long = { ...example, name: `${"a long name ".repeat(20)}.glb` };
    await choose(page, long);
    await settled(page);
    const height = () => page.$eval(".bar", (bar) => bar.clientHeight);
    const alone = await height();
    await choose(page, long, TRIANGLE);
    await page.locator("#file").waitFor();
    assert.equal(await height(), alone);
    await settled(page);
    const { x, width } = await page.locator("#panel").boundingBox();
    assert.ok(x + width <= page.viewportSize().width);
  });

  test("a tab is named after its file, and without one after the page", async () => {
    const page = await visit({ hash: "#levels=1", expected: [422] });
    const untitled = await page.title();
    await choose(page, { ...example, name: "nan.glb", buffer: broken(part) });
    await page.locator("#problem").waitFor();
    assert.equal(await page.title(), untitled);
    await choose(page, example);
    await settled(page);
    assert.equal(await page.title(), `${example.name} – PNS`);
  });
});

/** The meshes that may be chosen, as they are called. */
function namesListed(page) {
  return page.$eval("#file", ({ options }) => [...options].map(({ text }) => text));
}

/** The files in the folder of a document, but the document itself. */
async function neighbours(name) {
  const folder = dirname(join(FIXTURES, name));
  const names = await readdir(folder);
  return names.filter((other) => other !== basename(name)).map((other) => join(folder, other));
}

/** The number of faces that a label tells. */
function facesIn(label) {
  return Number(/([\d,]+) faces/.exec(label)[1].replaceAll(",", ""));
}
