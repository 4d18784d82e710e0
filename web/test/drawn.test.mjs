/** What is drawn of a file: both sides alike, in motion, with textures, whatever its reader takes amiss. */

import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { describe, test } from "node:test";
import { fileURLToPath } from "node:url";
import { choose, columns, noBrowser, picture, settled } from "./support/browser.mjs";
import { bare, moving, textured } from "./support/glb.mjs";
import { example, number, part, PART_FACES, same, studio } from "./support/studio.mjs";

const FOX = fileURLToPath(new URL("../../../shared/assets/Fox.glb", import.meta.url));
const FIXTURES = fileURLToPath(new URL("../../../shared/assets/fixtures/", import.meta.url));
// Both sides of a square that stays one: its corners are creases.
const SQUARE = "#levels=1&layout=side&crease=angle&angle=1";
/** Each an open corner of three faces or a tetrahedron. */
const AMISS = {
  "doubles.ply": [
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z",
    "element face 3\nproperty list uchar int vertex_indices\nend_header",
    "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n",
  ].join("\n"),
  "lines.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nl 1 2 \\\n3 4\nf 1 2 4\nf 2 3 4\nf 3 1 4\n",
  "far.obj": `v 4e6 4e6 0\nv ${4e6 + 0.25} 4e6 0\nv 4e6 ${4e6 + 0.25} 0\nv 4e6 4e6 0.25\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n`,
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

const HEADER = (format) =>
  `ply\nformat ${format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n` +
  "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
/** Pictures of one pixel. */
const DOTS = {
  "red one.png": "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR42mP4wMEBAALsAQEtiZ/+AAAAAElFTkSuQmCC",
  "green.png": "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAIAAACQd1PeAAAADElEQVR42mPg+MABAAIEAQFtP73zAAAAAElFTkSuQmCC",
};
const PLACES = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]];
/** One square, first as two triangles. */
const SQUARES = {
  "cut.obj": `${PLACES.map((place) => `v ${place.join(" ")}`).join("\n")}\nf 1 2 3\nf 1 3 4\n`,
  "square.obj": `${PLACES.map((place) => `v ${place.join(" ")}`).join("\n")}\nf 1 2 3 4\n`,
  "square.off": `OFF\n4 1 0\n${PLACES.map((place) => place.join(" ")).join("\n")}\n4 0 1 2 3\n`,
  "text.ply": `${HEADER("ascii")}${PLACES.map((place) => place.join(" ")).join("\n")}\n4 0 1 2 3\n`,
  "binary.ply": Buffer.concat([
    Buffer.from(HEADER("binary_little_endian")),
    Buffer.from(new Float32Array(PLACES.flat()).buffer),
    Buffer.from([4]),
    Buffer.from(new Int32Array([0, 1, 2, 3]).buffer),
  ]),
};

describe("what is drawn", { skip: noBrowser, timeout: 1_800_000 }, () => {
  const { visit, refined } = studio();

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

  test("an OBJ is drawn in the colours of its materials, which go to the service with it", async () => {
    const page = await visit({ hash: "#levels=1&layout=side" });
    const text = [
      "mtllib colours.mtl",
      "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0",
      "usemtl red\nf 1 2 3\nusemtl green\nf 1 3 4",
    ].join("\n");
    const library = "newmtl red\nKd 0.9 0.02 0.02\nnewmtl green\nKd 0.02 0.9 0.02\n";
    const sent = page.waitForRequest(/\/subdivide\?/);
    await choose(page, { name: "two.obj", mimeType: "", buffer: Buffer.from(text) }, { name: "colours.mtl", mimeType: "", buffer: Buffer.from(library) });
    assert.match((await sent).headers()["content-type"], /^multipart\/form-data/);
    await settled(page);
    const { red, green } = coloursOf(await picture(page), 0);
    assert.ok(red > 0.3 && green > 0.3, `${red} red, ${green} green`);
    assert.ok(await page.isHidden("#notice"));
  });

  test("textures that an OBJ names by paths of other machines are found among the files, and drawn", async () => {
    const page = await visit({ hash: "#levels=1&layout=side" });
    const text = [
      "mtllib D:\\parts\\colours.mtl",
      "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1",
      "usemtl red\nf 1/1 2/2 3/3\nusemtl green\nf 1/1 3/3 4/4",
    ].join("\n");
    const library = "newmtl red\nmap_Kd -s 1 1 1 C:\\tex\\red one.png\nnewmtl green\nmap_Kd /home/me/tex/green.png\n";
    const files = { "two.obj": text, "colours.mtl": library };
    for (const [name, png] of Object.entries(DOTS)) files[name] = Buffer.from(png, "base64");
    await choose(page, ...Object.entries(files).map(([name, content]) => ({ name, mimeType: "", buffer: Buffer.from(content) })));
    await settled(page);
    const shown = await picture(page);
    for (const from of [0, shown.width / 2]) {
      const { red, green } = coloursOf(shown, from);
      assert.ok(red > 0.3 && green > 0.3, `${red} red, ${green} green from ${from}`);
    }
    assert.ok(await page.isHidden("#notice"));
  });

  test("a polygon is drawn by its sides, whatever kind of file it comes in", async () => {
    const page = await visit({ hash: "#levels=1&layout=side&look=wire" });
    const drawn = [];
    for (const [name, content] of Object.entries(SQUARES)) {
      await choose(page, { name, mimeType: "", buffer: Buffer.from(content) });
      await page.locator("#file-name", { hasText: name }).waitFor();
      await settled(page);
      const shown = await picture(page);
      drawn.push(columns(shown, 0, shown.width / 2));
    }
    const [cut, ...whole] = drawn;
    for (const other of whole) same(other, whole[0]);
    const inked = (pixels) => pixels.filter((value, at) => at % 4 === 0 && value < 200).length;
    // A diagonal beside four sides.
    assert.ok(inked(cut) > 1.15 * inked(whole[0]), `${inked(cut)} and ${inked(whole[0])} pixels`);
  });

  test("what readers of their own kind take amiss is drawn on both sides, and certified", async () => {
    const page = await visit({ hash: "#levels=1&layout=side&crease=off" });
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
