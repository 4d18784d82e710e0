/** The kinds of file that the page opens, and what moves in them. */

import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { mkdtemp, readdir, readFile, rm, utimes, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { basename, dirname, join } from "node:path";
import { describe, test } from "node:test";
import { fileURLToPath } from "node:url";
import { zipSync } from "three/addons/libs/fflate.module.js";
import { choose, columns, noBrowser, picture, settled } from "./support/browser.mjs";
import { bare, broken, moving, read, textured, write } from "./support/glb.mjs";
import { example, number, part, PART_FACES, studio } from "./support/studio.mjs";

const FOX = fileURLToPath(new URL("../../../shared/assets/Fox.glb", import.meta.url));

const FIXTURES = fileURLToPath(new URL("../../../shared/assets/fixtures/", import.meta.url));
// Both sides of a square that stays one: its corners are creases.
const SQUARE = "#levels=1&layout=side&crease=angle&angle=1";
const TRIANGLE = {
  name: "triangle.obj",
  mimeType: "",
  buffer: Buffer.from("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
};
/** Each an open corner of three faces or a tetrahedron. */
const AMISS = {
  "doubles.ply": [
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z",
    "element face 3\nproperty list uchar int vertex_indices\nend_header",
    "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n",
  ].join("\n"),
  "lines.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nl 1 2 \\\n3 4\nf 1 2 4\nf 2 3 4\nf 3 1 4\n",
  "far.obj": `v 1e6 1e6 0\nv ${1e6 + 1} 1e6 0\nv 1e6 ${1e6 + 1} 0\nv 1e6 1e6 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n`,
  "no-scene.gltf": JSON.stringify({ ...bare(), scene: undefined, scenes: undefined }),
  "no-node.gltf": JSON.stringify({ ...bare(), scene: undefined, scenes: undefined, nodes: undefined }),
  "two-scenes.gltf": JSON.stringify({
    ...bare(),
    scene: 1,
    scenes: [{ nodes: [0] }, { nodes: [1] }],
    nodes: [{ mesh: 0 }, { mesh: 1 }],
    meshes: [bare().meshes[0], bare().meshes[0]],
  }),
};
const REFUSED = [
  ["BoxWithInfinites.glb", /NaN or infinity/],
  ["IndexOutOfRange.gltf", /index 255, but there are 24 vertices/],
  ["empty_nodes.glb", /no triangles/],
];

describe("files on the page", { skip: noBrowser, timeout: 1_800_000 }, () => {
  const { visit, refined, refusal } = studio();

  test("both sides of an animation stand at the same time", async () => {
    const page = await visit({ hash: "#levels=1&layout=side" });
    await choose(page, { ...example, buffer: moving(part, 0.5) });
    await settled(page);
    await page.selectOption("#clip", { label: "There" });
    const places = [];
    for (const time of ["0", "0.5", "1"]) {
      await page.locator("#scrub").fill(time);
      const shown = await picture(page);
      const [left, right] = [0, shown.width / 2].map((from) => middleOfShape(shown, from));
      assert.ok(Math.abs(left - right) < 3, `at ${time}: ${left} and ${right}`);
      places.push(left);
    }
    assert.ok(places[1] - places[0] > 8 && places[2] - places[1] > 8, `${places}`);
    await page.click("#play");
    await page.waitForFunction(() => document.querySelector("#scrub").value < 0.99);
    assert.equal(await page.getAttribute("#play", "aria-pressed"), "true");
    // Pressed, it is heard as that already: "Pause, pressed" would say that it stands.
    assert.equal(await page.getAttribute("#play", "aria-label"), "Play");
  });

  for (const compress of ["meshopt", "draco"]) {
    test(`a file compressed by ${compress} is shown`, async () => {
      const page = await visit({ hash: "#levels=1" });
      const packed = await refined(`levels=1&scheme=loop&compress=${compress}`);
      await choose(page, { ...example, buffer: packed });
      await settled(page);
      assert.match(await page.textContent("#label-left"), new RegExp(number(4 * PART_FACES)));
      await page.focus("#wipe");
      await page.keyboard.press("End");
      assert.ok(Number.isFinite(middleOfShape(await picture(page), 0, 1)));
    });
  }

  for (const kind of ["etc1s", "uastc"]) {
    test(`a texture in KTX2 (${kind}) is shown on both sides`, async () => {
      const page = await visit({ hash: SQUARE });
      await choose(page, ...(await square(kind)));
      await settled(page);
      await assertQuarters(page);
    });
  }

  test("a transcoder that did not come is asked for again", async () => {
    const page = await visit({ hash: SQUARE, foreseen: /ERR_FAILED/ });
    const transcoder = /basis_transcoder.*\.wasm$/;
    await page.route(transcoder, (route) => route.abort());
    await choose(page, ...(await square("etc1s")));
    await page.locator("#problem").waitFor();
    assert.match(await page.textContent("#problem-detail"), /transcoder/);
    await page.unroute(transcoder);
    await page.click("#problem-again");
    await settled(page);
    await assertQuarters(page);
  });

  test("a model that its clip carries out of the picture can be framed there", async () => {
    const page = await visit({ hash: "#levels=1&layout=single" });
    await choose(page, { ...example, name: "far.glb", buffer: moving(part, 60) });
    await settled(page);
    const isThere = async () => {
      const { data } = await picture(page);
      return !data.every((value, at) => value === data[at % 4]);
    };
    await page.selectOption("#clip", { label: "There" });
    await page.locator("#scrub").fill("1");
    assert.ok(!(await isThere()));
    await page.click("#frame");
    assert.ok(await isThere());
  });

  test("Fox runs at the same phase on both sides", { skip: !existsSync(FOX) && `needs ${FOX}` }, async () => {
    const page = await visit({ hash: "#levels=1&layout=side" });
    await choose(page, { name: "Fox.glb", mimeType: "", buffer: await readFile(FOX) });
    await settled(page);
    assert.match(await page.textContent("#label-right"), /· 2,304 faces/);
    await page.selectOption("#clip", { label: "Run" });
    const times = [0.1, 0.35, 0.6, 0.85];
    const poses = [];
    for (const time of times) {
      await page.locator("#scrub").fill(String(time));
      const shown = await picture(page);
      poses.push([0, shown.width / 2].map((from) => silhouette(shown, from)));
    }
    for (const [number, [control]] of poses.entries()) {
      const likeness = poses.map(([, ours]) => overlap(control, ours));
      assert.ok(likeness[number] > 0.8, `at ${times[number]}: ${likeness}`);
      assert.ok(
        likeness.every((other, i) => i === number || other < likeness[number] - 0.05),
        `another phase is as near at ${times[number]}: ${likeness}`,
      );
    }
  });

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

  test("an OBJ is converted, shown and told of", async () => {
    const page = await visit({ hash: "#levels=1" });
    const text = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nusemtl red\nf 1/1 2//1 3 4 # a square\nf -5 \\\n-4 5\n";
    await choose(page, { name: "a.obj", mimeType: "", buffer: Buffer.from(text) });
    await settled(page);
    assert.match(await page.textContent("#label-left"), /\D3 faces/);
    assert.match(await page.textContent("#label-right"), /· 12 faces/);
    assert.match(await page.textContent("#changes"), /materials dropped/);
    assert.equal(await page.textContent("#statistics tr:has-text('Vertices in the file') td"), "5");
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
    assert.match(await page.textContent("#problem-title"), /No mesh/);
  });

  const zipped = Buffer.from(zipSync({ "a.obj": Buffer.from("v 0 0 0") }));
  for (const [name, buffer, words] of [
    ["empty.glb", Buffer.alloc(0), /^The file is empty/],
    ["mesh.zip", zipped, /^No glTF in this archive.*a\.obj/],
    ["text.txt", Buffer.from("hello"), /^No mesh among these files/],
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
      assert.equal(await page.textContent("#problem-detail"), detail);
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

  test("what readers of their own kind take amiss is drawn on both sides, and certified", async () => {
    const page = await visit({ hash: "#levels=1&layout=side" });
    for (const [name, content] of Object.entries(AMISS)) {
      await choose(page, { name, mimeType: "", buffer: Buffer.from(content) });
      await page.locator("#file-name", { hasText: name }).waitFor();
      await settled(page);
      const shown = await picture(page);
      for (const from of [0, shown.width / 2]) assert.ok(middleOfShape(shown, from) > 0, `${name} from ${from}`);
      assert.doesNotMatch(await page.textContent("#promises"), /Broken|than 0\u00a0/, name);
      assert.equal(/own rounding/.test(await page.textContent("#mathematics")), name === "far.obj");
    }
  });

  test("copies of an instanced mesh are measured and framed as meshes are", { skip: !existsSync(FIXTURES) && `needs ${FIXTURES}` }, async () => {
    const page = await visit({ hash: "#levels=1&layout=single" });
    await choose(page, join(FIXTURES, "simple-instancing.glb"));
    await settled(page);
    assert.doesNotMatch(await page.textContent("#promises"), /Broken|than 0\u00a0/);
    const shown = await picture(page);
    // A copy at each place of a grid: there is paper between them.
    const row = columns(shown, 0, shown.width).subarray(4 * shown.width * Math.floor(shown.height / 3));
    const dark = Array.from({ length: shown.width }, (_, x) => row[4 * x] < 235);
    const shapes = dark.filter((here, x) => here && !dark[x - 1]).length;
    assert.ok(shapes > 2, `${shapes} shapes`);
  });

});

/** The meshes that may be chosen, as they are called. */
function namesListed(page) {
  return page.$eval("#file", ({ options }) => [...options].map(({ text }) => text));
}

/** A square with a texture of four colours, and its texture beside it. */
async function square(kind) {
  const name = `quarters-${kind}.ktx2`;
  const texture = await readFile(new URL(`./textures/${name}`, import.meta.url));
  const document = Buffer.from(JSON.stringify(textured(name)));
  return [
    { name: "square.gltf", mimeType: "", buffer: document },
    { name, mimeType: "", buffer: texture },
  ];
}

/** Each colour fills about a quarter of the shape, on either side. */
async function assertQuarters(page) {
  const shown = await picture(page);
  for (const from of [0, shown.width / 2]) {
    const parts = coloursOf(shown, from);
    for (const colour of ["red", "green", "blue", "yellow"]) {
      assert.ok(parts[colour] > 0.15 && parts[colour] < 0.35, JSON.stringify(parts));
    }
  }
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

/** For each pixel of the part of a picture that begins at `from`: whether it is not background. */
function silhouette({ width, height, data }, from, parts = 2) {
  const background = data.readUInt32LE(4 * (width * (height - 1) + from));
  const columns = width / parts;
  return Uint8Array.from({ length: columns * height }, (_, i) => {
    const pixel = width * Math.floor(i / columns) + from + (i % columns);
    return Number(data.readUInt32LE(4 * pixel) !== background);
  });
}

/** The mean column of what is not background. */
function middleOfShape(shown, from, parts = 2) {
  const columns = shown.width / parts;
  let [sum, count] = [0, 0];
  silhouette(shown, from, parts).forEach((inside, i) => {
    sum += inside * (i % columns);
    count += inside;
  });
  return sum / count;
}

/** What two silhouettes have in common, as a part of what they cover together. */
function overlap(a, b) {
  let [both, either] = [0, 0];
  a.forEach((inside, i) => {
    both += inside & b[i];
    either += inside | b[i];
  });
  return both / either;
}

/** The parts of a shape that are of each colour, in the half of a picture that begins at `from`. */
function coloursOf(shown, from) {
  const { width, data } = shown;
  const counts = { red: 0, green: 0, blue: 0, yellow: 0 };
  let all = 0;
  silhouette(shown, from).forEach((inside, i) => {
    if (!inside) return;
    all++;
    const pixel = width * Math.floor(i / (width / 2)) + from + (i % (width / 2));
    const [r, g, b] = data.subarray(4 * pixel, 4 * pixel + 3);
    if (r > 2 * g && r > 2 * b) counts.red++;
    if (g > 2 * r && g > 2 * b) counts.green++;
    if (b > 2 * r && b > 2 * g) counts.blue++;
    if (r > 2 * b && g > 2 * b) counts.yellow++;
  });
  return Object.fromEntries(Object.entries(counts).map(([colour, count]) => [colour, count / all]));
}
