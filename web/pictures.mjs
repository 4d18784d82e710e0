/** The pictures of README and docs: `node pictures.mjs`, against a server that it starts itself. */

import { fileURLToPath } from "node:url";
import { launch, open, settled } from "./test/support/browser.mjs";
import { serve } from "./test/support/server.mjs";

const docs = fileURLToPath(new URL("../docs/", import.meta.url));
const WIDE = { width: 1280, height: 800 };

const PICTURES = {
  "page.png": { hash: "" },
  "page-dark.png": {
    hash: "#look=distance&layout=side&pair=loop",
    options: { colorScheme: "dark" },
    done: (page) => page.locator("#legend").waitFor(),
  },
  "page-phone.png": {
    hash: "#look=zebra",
    options: { viewport: { width: 390, height: 844 }, hasTouch: true },
  },
};

const server = await serve();
await server.warm();
const browser = await launch();
for (const [name, { hash, options = {}, done }] of Object.entries(PICTURES)) {
  const { page, context } = await open(browser, `${server.address}/${hash}`, { viewport: WIDE, ...options });
  await page.click("#example");
  await settled(page);
  await done?.(page);
  // No focus ring where nobody pressed a key.
  await page.evaluate(() => document.activeElement.blur());
  await page.screenshot({ path: docs + name });
  console.log(`docs/${name}`);
  await context.close();
}
await browser.close();
await server.close();
