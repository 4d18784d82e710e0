/** For a group of tests: one server, one browser, and pages whose faults are looked at after each. */

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { after, afterEach, before } from "node:test";
import { launch, open } from "./browser.mjs";
import { serve } from "./server.mjs";

/** A part of so many faces, with normals and texture coordinates: what `pns example` writes. */
export const part = await readFile(new URL("../part.glb", import.meta.url));
export const PART_FACES = 1920;
export const example = { name: "part.glb", mimeType: "", buffer: part };

/** A file of four faces, without normals. */
export const TETRAHEDRON = {
  name: "tetrahedron.obj",
  mimeType: "",
  buffer: Buffer.from("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"),
};

/** Call it inside `describe`; `settings` are the server's. */
export function studio(settings = {}) {
  let server;
  let browser;
  let opened = [];

  before(async () => {
    [server, browser] = await Promise.all([serve(settings), launch()]);
    await server.warm();
  });
  after(async () => {
    await browser?.close();
    await server?.close();
  });
  afterEach(async () => {
    const faults = opened.flatMap(({ faults }) => faults);
    await Promise.all(opened.map(({ context }) => context.close()));
    opened = [];
    assert.deepEqual(faults, []);
  });

  return {
    /** A page whose faults fail the test once it is over. */
    async visit({ hash = "", ...rest } = {}) {
      const visited = await open(browser, `${server.address}/${hash}`, rest);
      opened.push(visited);
      return visited.page;
    },
    /** The problem by which the service itself refuses a body. */
    async refusal(query, body, type) {
      const init = { method: "POST", headers: { "Content-Type": type }, body };
      return (await fetch(`${server.address}/subdivide?${query}`, init)).json();
    },
    /** What the service itself answers. */
    async refined(query, body = part, type = "model/gltf-binary") {
      const answer = await fetch(`${server.address}/subdivide?${query}`, {
        method: "POST",
        headers: { "Content-Type": type },
        body,
      });
      assert.equal(answer.status, 200);
      return Buffer.from(await answer.arrayBuffer());
    },
  };
}

/** Equal bytes; a difference is counted, not printed by the million. */
export function same(bytes, wanted) {
  assert.equal(bytes.length, wanted.length);
  let different = 0;
  for (let i = 0; i < bytes.length; i++) different += Number(bytes[i] !== wanted[i]);
  assert.equal(different, 0, `${different} of ${bytes.length} bytes differ`);
}

/** A number as the page writes it. */
export function number(value) {
  return value.toLocaleString("en-US");
}
