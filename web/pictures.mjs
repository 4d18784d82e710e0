/** The pictures of README and docs: `node pictures.mjs`, against a server that it starts itself. */

import { existsSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { choose, launch, open, settled } from "./test/support/browser.mjs";
import { serve } from "./test/support/server.mjs";

const docs = fileURLToPath(new URL("../docs/", import.meta.url));
const assets = fileURLToPath(new URL("../../shared/assets/", import.meta.url));
const WIDE = { width: 1280, height: 800 };

/** `done` brings what else is to be seen. Without `files` it is the example. */
const PICTURES = {
  "page.png": {},
  "page-dark.png": {
    hash: "#look=distance&layout=side&pair=loop",
    options: { colorScheme: "dark" },
    done: (page) => page.locator("#legend").waitFor(),
  },
  "page-clip.png": {
    hash: "#layout=side&edges=1",
    files: ["Fox.glb", "barrel_large_decorated.glb"],
    done: async (page) => {
      await page.press("#notice-close", "Enter");
      await page.selectOption("#clip", { label: "Run" });
      await page.locator("#scrub").fill("0.55");
      await page.press("#canvas", "f");
    },
  },
  "page-phone.png": {
    hash: "#look=zebra&pair=loop",
    options: { viewport: { width: 390, height: 844 }, hasTouch: true },
  },
};

const server = await serve();
await server.warm();
const browser = await launch();
for (const [name, { hash = "", files, options = {}, done }] of Object.entries(PICTURES)) {
  const missing = files?.find((file) => !existsSync(assets + file));
  if (missing) {
    console.log(`docs/${name} stays: it needs ${assets}${missing}`);
    continue;
  }
  const { page, context } = await open(browser, `${server.address}/${hash}`, { viewport: WIDE, ...options });
  if (files) await choose(page, ...files.map((file) => assets + file));
  else await page.click("#example");
  await settled(page);
  await done?.(page);
  // Without a focus ring.
  await page.evaluate(() => document.activeElement.blur());
  // The fine picture comes once nothing moves.
  await page.waitForTimeout(1000);
  await page.screenshot({ path: docs + name });
  console.log(`docs/${name}`);
  await context.close();
}
await browser.close();
await server.close();
