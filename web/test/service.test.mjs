/** The page and the service's limits: full, slow, locked, behind a proxy. */

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { createServer, request } from "node:http";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, describe, test } from "node:test";
import { choose, launch, noBrowser, open, settled } from "./support/browser.mjs";
import { PNS, serve } from "./support/server.mjs";

const part = await readFile(new URL("./part.glb", import.meta.url));
// One worker, nobody may wait, and no job is short enough for the worker of its own.
const ALONE = { PNS_QUEUE: "0", PNS_METRICS_PORT: "0" };
const example = { name: "part.glb", mimeType: "", buffer: part };

describe("the page", { skip: noBrowser, timeout: 1_800_000 }, () => {
  let browser;
  before(async () => (browser = await launch()));
  after(() => browser?.close());

  async function with_(settings, visit, options = {}) {
    const server = await serve(settings);
    try {
      await server.ready();
      const opened = await open(browser, `${server.address}/${options.hash ?? ""}`, options);
      await visit({ server, ...opened });
      assert.deepEqual(opened.faults, []);
      await opened.context.close();
    } finally {
      await server.close();
    }
  }

  test("a base scheme that the service adds is among the rules", async () => {
    // The documentation's, in a file and a line of its own: old points stay, new ones halve the edges.
    const docs = await readFile(new URL("../../docs/reference/python.md", import.meta.url), "utf8");
    const [, code] = /```python\n([^`]*BaseScheme\([^`]*)```/.exec(docs);
    const folder = await mkdtemp(join(tmpdir(), "scheme-"));
    await writeFile(join(folder, "linear.py"), code);
    const line = 'from pns_common.scheme_names import BASE_SCHEMES\nBASE_SCHEMES["linear"] = "linear:LINEAR"\n';
    await writeFile(join(folder, "sitecustomize.py"), line);
    await with_({ PYTHONPATH: folder }, async ({ page }) => {
      await choose(page, example);
      await settled(page);
      await page.click(".more summary");
      await page.selectOption("#model", { label: "linear" });
      await page.locator("#label-right", { hasText: "linear" }).waitFor();
      await settled(page);
      await page.locator("#promises", { hasText: /This is linear’s rule alone\. .*%/ }).waitFor();
      await page.selectOption("#look", "distance");
      await page.waitForFunction(() => Number(document.querySelector("#legend").dataset.max) > 0);
      assert.match(page.url(), /model=scheme%3Alinear/);
    });
    await rm(folder, { recursive: true });
  });

  test("a slow job is seen to move, and cancel frees its worker", async (t) => {
    // A model that acts at every level, and the most faces that the service takes: seconds of work,
    // looked at four times a second, and cancelled as soon as it was seen to move. One worker, and
    // nobody may wait: whoever is let in was let in because the worker is free.
    await with_(ALONE, async ({ page, server }) => {
      await page.evaluate(() => {
        window.shares = new Set();
        new MutationObserver(() => {
          const { value } = document.querySelector("#work-bar");
          const working = /^(?!Uploading|Downloading)/.test(document.querySelector("#work-text").textContent);
          if (working && value > 0 && value < 1) window.shares.add(value);
        }).observe(document.querySelector("#work"), { subtree: true, childList: true, attributes: true });
      });
      await choose(page, example);
      await page.waitForFunction(() => window.shares.size > 1);
      await server.reaches("pns_jobs_running", 1);
      assert.equal((await slowJob(server)).status, 429);
      const began = performance.now();
      await page.click("#cancel");
      await server.reaches("pns_jobs_running", 0);
      t.diagnostic(`the worker was free ${Math.round(performance.now() - began)} ms after the click`);
      assert.ok(await page.isHidden("#work"));
      const next = await slowJob(server);
      assert.equal(next.status, 200);
      await next.leave();
      // The control mesh stays, and the worker takes the next job.
      await page.selectOption("#levels", "1");
      await settled(page);
    }, { hash: "#levels=5" });
  });

  test("a service that goes away at work, in words, with another try", async () => {
    await with_({}, async ({ page, server }) => {
      // As soon as the page follows the job, seconds before it is done.
      const followed = page.waitForResponse((answer) => answer.url().includes("/subdivide?"));
      await choose(page, example);
      await followed;
      await server.kill();
      await page.locator("#problem").waitFor();
      assert.equal(await page.textContent("#problem-title"), "The connection broke twice");
      assert.ok(await page.isVisible("#problem-again"));
      assert.ok(await page.isHidden("#work"));
    }, { hash: "#levels=5", foreseen: /net::ERR_/ });
  });

  test("413: a body over the limit", async () => {
    await with_({ PNS_BODY: "10kB" }, async ({ page }) => {
      await page.route(/\/limits$/, (route) => route.abort());
      await page.reload();
      await choose(page, example);
      await page.locator("#problem-title", { hasText: "over a limit" }).waitFor();
      assert.match(await page.textContent("#problem-detail"), /10000/);
    }, { expected: [413], foreseen: /ERR_FAILED/ });
  });

  test("a body over the limit that the page knows is not sent", async () => {
    await with_({ PNS_BODY: "10kB" }, async ({ page }) => {
      await page.locator("#limits", { hasText: "up to 10 kB" }).waitFor();
      page.on("request", (request) => assert.notEqual(request.method(), "POST"));
      await choose(page, example);
      assert.equal(await page.textContent("#problem-title"), "The file is too large");
      assert.match(await page.textContent("#problem-detail"), /part\.glb has [\d.]+\u00a0kB; this service takes up to 10\u00a0kB/);
      assert.ok(await page.isHidden("#problem-again"));
    });
  });

  test("a mesh to which no level is open is not sent", async () => {
    await with_({ PNS_FACES: "5000" }, async ({ page }) => {
      await page.locator("#limits:not(:empty)").waitFor();
      page.on("request", (request) => assert.notEqual(request.method(), "POST"));
      await choose(page, example);
      await page.locator("#problem").waitFor();
      assert.equal(await page.textContent("#problem-title"), "The mesh is too large");
      assert.equal(
        await page.textContent("#problem-detail"),
        "part.glb would have 7,680 faces after 1 step, over the limit of 5,000 faces of this service.",
      );
      assert.ok(await page.isHidden("#problem-again"));
      assert.ok(await page.isVisible("#welcome"));
      assert.equal(await page.textContent("#levels-note"), "");
    });
  });

  test("levels over the limit are closed, and say why", async () => {
    await with_({ PNS_FACES: "50000" }, async ({ page }) => {
      await choose(page, example);
      await settled(page);
      // 1,920 faces are 30,720 after two levels, and 122,880 after three.
      assert.equal(await page.inputValue("#levels"), "2");
      assert.ok(await page.locator('#levels option[value="3"]').isDisabled());
      assert.match(await page.textContent("#levels-note"), /50,000 faces/);
    }, { hash: "#levels=4" });
  });

  test("429: more than one client may have, in words, with another try", async () => {
    await with_(ALONE, async ({ page, server }) => {
      const job = await slowJob(server);
      await choose(page, example);
      await page.locator("#problem").waitFor();
      assert.equal(await page.textContent("#problem-title"), "The client has too many requests under way");
      assert.notEqual(await page.textContent("#problem-detail"), "");
      await job.leave();
      await server.reaches("pns_requests_held", 0);
      await page.click("#problem-again");
      await settled(page);
      assert.ok(await page.isHidden("#problem"));
    }, { expected: [429], hash: "#levels=3" });
  });

  for (const [path, settings] of [
    ["/tools/pns/", {}],
    ["/tools/pns", { PNS_PREFIX: "/tools/pns" }],
  ]) {
    test(`under a proxy's prefix nothing is missing (${path})`, async () => {
      const server = await serve(settings);
      await server.ready();
      const proxy = createServer((incoming, outgoing) => {
        if (!/^\/tools\/pns(\/|$)/.test(incoming.url)) return outgoing.writeHead(404).end();
        const to = new URL(incoming.url.slice("/tools/pns".length) || "/", server.address);
        const { method, headers } = incoming;
        incoming.pipe(
          request(to, { method, headers }, (answer) => {
            outgoing.writeHead(answer.statusCode, answer.headers);
            answer.pipe(outgoing);
          }),
        );
      });
      await new Promise((resolve) => proxy.listen(0, "127.0.0.1", resolve));
      try {
        const address = `http://127.0.0.1:${proxy.address().port}${path}#levels=1`;
        const { page, faults, context } = await open(browser, address);
        await page.click("#example");
        await settled(page);
        assert.match(await page.textContent("#label-right"), /3,936 faces/);
        assert.deepEqual(faults, []);
        await context.close();
      } finally {
        proxy.closeAllConnections();
        proxy.close();
        await server.close();
      }
    });
  }

  test("with keys on, the page asks for one and keeps it in memory alone", async () => {
    const folder = await mkdtemp(join(tmpdir(), "pns-keys-"));
    const script = `"${PNS}" key studio > "${folder}/keys.toml" 2> "${folder}/key"`;
    execFileSync("sh", ["-c", script]);
    const key = (await readFile(join(folder, "key"), "utf8")).trim();
    try {
      await with_({ PNS_KEYS_FILE: join(folder, "keys.toml") }, async ({ page }) => {
        await choose(page, example);
        await page.locator("#key-form").waitFor();
        const sent = new Map();
        page.on("request", async (request) => {
          sent.set(`${request.method()} ${new URL(request.url()).pathname}`, (await request.allHeaders()).authorization);
        });
        await page.fill("#key", key);
        await page.keyboard.press("Enter");
        assert.equal(await page.evaluate(() => document.activeElement.id), "canvas");
        await settled(page);
        assert.equal(sent.get("POST /subdivide"), `Bearer ${key}`);
        const stored = await page.evaluate(() =>
          JSON.stringify([{ ...localStorage }, { ...sessionStorage }, document.cookie, location.href]),
        );
        assert.ok(!stored.includes(key));
        await page.reload();
        await choose(page, example);
        await page.locator("#key-form").waitFor();
      }, { expected: [401], hash: "#levels=1" });
    } finally {
      await rm(folder, { recursive: true });
    }
  });
});

/** Ask for seconds of work; `leave` ends it. */
async function slowJob(server) {
  const leaving = new AbortController();
  const answer = await fetch(`${server.address}/subdivide?levels=5`, {
    method: "POST",
    headers: { "Content-Type": "model/gltf-binary", Accept: "multipart/mixed" },
    body: part,
    signal: leaving.signal,
  });
  return { status: answer.status, leave: () => leaving.abort() };
}
