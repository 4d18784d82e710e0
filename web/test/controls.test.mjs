/** Settings, links, and the page without a mouse. */

import assert from "node:assert/strict";
import { describe, test } from "node:test";
import { choose, noBrowser, picture, settled } from "./support/browser.mjs";
import { CUBE } from "./support/solids.mjs";
import { example, number, PART_FACES, same, studio } from "./support/studio.mjs";

describe("controls", { skip: noBrowser, timeout: 1_800_000 }, () => {
  const { visit } = studio();

  test("what is compared is chosen only where two sides stand", async () => {
    const page = await visit({ hash: "#levels=1" });
    await choose(page, CUBE);
    await settled(page);
    for (const [layout, open] of Object.entries({ wipe: true, side: true, overlay: false, single: false })) {
      await page.check(`input[name="layout"][value="${layout}"]`);
      assert.equal(await page.isEnabled("#pair"), open, layout);
    }
  });

  test("choices are read whole, and stand under each other", async () => {
    const page = await visit({ hash: "#levels=1", viewport: { width: 1280, height: 800 } });
    await choose(page, example);
    await settled(page);
    await page.click(".more summary");
    const short = await page.$$eval(".row select, .tools select", (selects) => {
      const context = document.createElement("canvas").getContext("2d");
      const arrow = 18;
      return selects.flatMap((select) => {
        const { font, paddingLeft, paddingRight } = getComputedStyle(select);
        context.font = font;
        const room = select.clientWidth - parseFloat(paddingLeft) - parseFloat(paddingRight) - arrow;
        return [...select.options].map(({ text }) => text).filter((text) => context.measureText(text).width > room);
      });
    });
    assert.deepEqual(short, []);
    const edges = await page.$$eval(".more select", (selects) => selects.map((select) => select.getBoundingClientRect().left));
    assert.equal(new Set(edges).size, 1, String(edges));
    await page.selectOption("#crease", "angle");
    assert.ok(await page.$eval(".with-unit", (number) => number.scrollWidth <= number.clientWidth), "a unit stands aside");
  });

  test("nothing behind them is seen through the tools, the timeline, the legend and the labels", async () => {
    const page = await visit();
    const sheets = await page.$$eval(".tools, .timeline, .legend, .side-label", (floating) =>
      floating.map((one) => getComputedStyle(one).backgroundColor),
    );
    const panel = await page.$eval(".panel", (panel) => getComputedStyle(panel).backgroundColor);
    assert.deepEqual([...new Set(sheets)], [panel]);
  });

  test("a number that cannot be is told, and asks for nothing", async () => {
    const page = await visit({ hash: "#levels=1&crease=angle" });
    await choose(page, example);
    await settled(page);
    page.on("request", (request) => assert.notEqual(request.method(), "POST"));
    await page.evaluate(() => {
      document.querySelector("#angle").reportValidity = function () {
        window.told = this.validationMessage;
        return this.checkValidity();
      };
    });
    await page.fill("#angle", "-1");
    assert.match(await page.evaluate(() => window.told), /0/);
    await page.waitForTimeout(500);
    assert.ok(!(await page.evaluate(() => location.hash)).includes("angle=-1"));
  });

  test("beside a number that cannot be, whether it is seen or not, other settings may change", async () => {
    const page = await visit({ hash: "#levels=1&crease=angle&angle=25.5" });
    await choose(page, example);
    await settled(page);
    assert.ok(await page.$eval("#angle", (angle) => angle.validity.valid));
    await page.fill("#angle", "999");
    await page.selectOption("#levels", "2");
    await page.locator("#label-right", { hasText: `${number(16 * PART_FACES)} faces` }).waitFor({ timeout: 20_000 });
    assert.match(await page.evaluate(() => location.hash), /angle=25\.5/);
  });

  test("a link restores the settings", async () => {
    const page = await visit();
    await choose(page, example);
    await settled(page);
    await page.selectOption("#levels", "1");
    await page.click(".more summary");
    await page.selectOption("#model", "loop");
    await page.selectOption("#look", "zebra");
    await page.focus("#canvas");
    await page.keyboard.press("n");
    await page.selectOption("#crease", "angle");
    await page.fill("#angle", "25");
    await page.waitForFunction(() => location.hash.includes("angle=25"));
    const hash = await page.evaluate(() => location.hash);
    const other = await visit({ hash });
    for (const [id, value] of [["levels", "1"], ["look", "zebra"], ["crease", "angle"], ["angle", "25"]]) {
      assert.equal(await other.inputValue(`#${id}`), value);
    }
    assert.ok(await other.isChecked("#normal-lines"));
    await other.waitForFunction(() => document.querySelector("#model").value === "loop");
  });

  test("a link restores the camera, of a model of any size, until another file comes", async () => {
    const page = await visit({ hash: "#levels=1&layout=single" });
    await choose(page, CUBE);
    await settled(page);
    const framed = await picture(page);
    assert.ok(!(await page.evaluate(() => location.hash)).includes("camera"));
    for (const key of ["ArrowRight", "ArrowRight", "ArrowUp", "-"]) await page.press("#canvas", key);
    await page.waitForFunction(() => location.hash.includes("camera"));
    const turned = await picture(page);
    const hash = await page.evaluate(() => location.hash);
    const other = await visit({ hash });
    const large = { ...CUBE, buffer: Buffer.from(CUBE.buffer.toString().replaceAll("0.5", "50")) };
    await choose(other, large);
    await settled(other);
    const restored = await picture(other);
    const share = (a, b) => a.data.filter((value, i) => Math.abs(value - b.data[i]) > 8).length / a.data.length;
    assert.ok(share(restored, turned) < 0.003 && share(restored, framed) > 0.01);
    await choose(other, CUBE);
    await settled(other);
    assert.ok(!(await other.evaluate(() => location.hash)).includes("camera"));
    assert.ok(share(await picture(other), framed) < 0.003);
    // Six numbers, or nothing.
    for (const camera of ["", "1,2,3", "1,2,3,4,5,x", "1e9,0,0,0,0,0"]) {
      await other.evaluate((camera) => (location.hash = `#levels=1&layout=single&camera=${camera}`), camera);
      await other.waitForFunction(() => !location.hash.includes("camera"));
      assert.ok(share(await picture(other), framed) < 0.003, camera);
    }
  });

  test("a link that is followed in the page’s own tab changes the settings there", async () => {
    const page = await visit({ hash: "#levels=1&look=zebra" });
    await choose(page, example);
    await settled(page);
    await page.evaluate(() => (location.hash = "#levels=2&edges=1&layout=side"));
    await page.locator("#label-right", { hasText: `${number(16 * PART_FACES)} faces` }).waitFor();
    assert.ok(await page.isChecked("#edges"));
    assert.ok(await page.isChecked('input[value="side"]'));
    assert.equal(await page.inputValue("#look"), "material");
    await settled(page);
    // The way past the canvas is no setting.
    await page.locator(".skip").press("Enter");
    assert.ok(await page.evaluate(() => document.activeElement.id === "panel" && location.hash.includes("edges=1")));
  });

  test("without a mouse: the example, the view, the wipe", async () => {
    const page = await visit({ hash: "#levels=1" });
    await page.focus("#example");
    await page.keyboard.press("Enter");
    await settled(page);
    await page.focus("#canvas");
    const before = await picture(page);
    await page.focus("#canvas");
    for (const key of ["ArrowRight", "ArrowUp", "-"]) await page.keyboard.press(key);
    const turned = await picture(page);
    assert.ok(!turned.data.equals(before.data));
    await page.focus("#canvas");
    await page.keyboard.press("f");
    same((await picture(page)).data, before.data);
    await page.focus("#canvas");
    await page.keyboard.press("3");
    assert.ok(await page.isChecked('input[value="overlay"]'));
    await page.keyboard.press("1");
    await page.press("#wipe", "ArrowUp");
    assert.equal(await page.getAttribute("#wipe", "aria-valuenow"), "52");
  });

  test("a screen reader hears each step once, and no percents of it", async () => {
    const page = await visit({ hash: "#levels=4" });
    await page.evaluate(() => {
      window.heard = [];
      const hear = ({ target }) => {
        const region = (target instanceof Element ? target : target.parentElement).closest("[role=status], [role=alert]");
        if (region) window.heard.push(region.textContent);
      };
      new MutationObserver((changes) => changes.forEach(hear)).observe(document.body, {
        subtree: true,
        childList: true,
        characterData: true,
      });
    });
    await choose(page, example);
    await settled(page);
    const heard = await page.evaluate(() => window.heard);
    assert.deepEqual(heard.slice(0, 2), ["Opening the file", "Uploading"]);
    assert.match(heard.at(-1), /^Done\. /);
    assert.deepEqual(heard.slice(0, -1).filter((text) => /\d|^$/.test(text)), []);
    assert.ok(heard.every((text, i) => text !== heard[i - 1]), heard.join(" | "));
  });

  test("words may be dropped into a field", async () => {
    const page = await visit();
    const words = await page.evaluateHandle(() => {
      const transfer = new DataTransfer();
      transfer.setData("text/plain", "3");
      return transfer;
    });
    await page.dispatchEvent("#angle", "drop", { dataTransfer: words });
    // What is dropped is read in the same turn.
    await page.waitForTimeout(100);
    assert.ok(await page.isHidden("#problem"));
  });
});
