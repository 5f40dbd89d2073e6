// The report of made-up results in a real browser: 200 and 10,000 stones.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync, statSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { after, before, describe, test } from "node:test";
import { fileURLToPath } from "node:url";
import { launch, open } from "./browser.mjs";

const root = join(dirname(fileURLToPath(import.meta.url)), "../..");
let browser, folder;

before(async () => {
  folder = mkdtempSync(join(tmpdir(), "stonewise-report-"));
  execFileSync("cargo", ["build", "-q", "-p", "stonewise", "--example", "sample_report"], { cwd: root, stdio: "inherit" });
  const target = process.env["CARGO_TARGET_DIR"] ?? join(root, "target");
  for (const stones of [200, 10_000]) {
    execFileSync(join(target, "debug/examples/sample_report"), [String(stones), join(folder, String(stones))]);
  }
  browser = await launch();
});

after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true, force: true });
});

const report = (stones) => join(folder, String(stones), "report/index.html");

/** How many different colours a canvas shows, from a coarse sample. */
const colours = (page, selector) =>
  page.$eval(selector, (canvas) => {
    const copy = document.createElement("canvas");
    [copy.width, copy.height] = [160, 120];
    const pen = copy.getContext("2d");
    pen.drawImage(canvas, 0, 0, 160, 120);
    const data = pen.getImageData(0, 0, 160, 120).data;
    const seen = new Set();
    for (let i = 0; i < data.length; i += 4) seen.add((data[i] >> 4) * 4096 + (data[i + 1] >> 4) * 64 + (data[i + 2] >> 4));
    return seen.size;
  });

for (const stones of [200, 10_000]) {
  describe(`${stones} stones`, () => {
    let page, trouble, close;
    before(async () => ({ page, trouble, close } = await open(browser, report(stones))));
    after(() => close());

    test("every quantity draws a map", async () => {
      const keys = await page.$$eval("#quantity option", (options) => options.map((o) => o.value));
      assert.ok(keys.length >= 11, keys.join());
      for (const key of keys) {
        await page.selectOption("#quantity", key);
        await page.waitForFunction((k) => document.querySelector(".wall-map canvas").dataset.drawn?.startsWith(k), key);
        assert.ok((await colours(page, ".wall-map canvas")) >= 4, `${key} is blank`);
      }
      await page.selectOption("#quantity", "out");
    });

    test("a search opens the stone with its numbers", async () => {
      await page.fill("#search", "42");
      assert.equal(await page.textContent(".stone-panel h3"), "Stone 42");
      assert.match(await page.textContent(".stone-panel .numbers"), /along.*up.*out.*length/s);
      assert.equal(await page.locator(".stone-panel .pair svg").count(), 2);
      await page.fill("#search", "999999");
      assert.equal(await page.getAttribute("#search", "aria-invalid"), "true");
      await page.fill("#search", "");
    });

    test("a click on the map chooses the stone under it, Escape lets go", async () => {
      await page.click("text=whole wall");
      const box = await page.locator(".wall-map canvas").boundingBox();
      await page.mouse.click(box.x + box.width / 2 + 3, box.y + box.height / 2);
      await page.waitForSelector(".stone-panel h3");
      await page.focus(".wall-map canvas");
      await page.keyboard.press("Escape");
      assert.equal(await page.locator(".stone-panel h3").count(), 0);
    });

    test("a line across the map gives a profile with bands", async () => {
      await page.click("text=whole wall");
      await page.click("#draw-profile");
      const box = await page.locator(".wall-map canvas").boundingBox();
      await page.mouse.move(box.x + box.width * 0.3, box.y + box.height / 2);
      await page.mouse.down();
      await page.mouse.move(box.x + box.width * 0.5, box.y + box.height / 2, { steps: 4 });
      await page.mouse.up();
      await page.waitForSelector(".profile .band");
      assert.equal(await page.locator(".profile > svg").count(), 3);
      assert.ok((await page.locator(".profile .band").count()) >= 9);
      assert.equal(await page.getAttribute("#draw-profile", "aria-pressed"), "false");
    });

    test("the keyboard alone reaches search, stone, neighbours and profile", async () => {
      await page.focus("#search");
      await page.keyboard.type("57");
      const reached = new Set();
      for (let i = 0; i < 40; i++) {
        await page.keyboard.press("Tab");
        reached.add(await page.evaluate(() => document.activeElement.closest("[id], canvas, .stone-panel a, .stone-panel button")?.textContent ?? "canvas"));
      }
      for (const what of ["level", "upright", "\u2192", "58"]) assert.ok(reached.has(what), `${what} not reached`);
    });

    test("nothing went wrong, nothing was fetched", () => assert.deepEqual(trouble, []));
  });
}

test("names from inputs stay text", async () => {
  const { page, trouble, close } = await open(browser, report(200));
  let dialogs = 0;
  page.on("dialog", () => dialogs++);
  assert.match(await page.textContent("h1"), /<\/title><script>alert\(1\)<\/script>/);
  assert.match(await page.textContent("#audit"), /<script>\.jpg/);
  assert.equal(dialogs, 0);
  assert.deepEqual(trouble, []);
  await close();
});

test("the page stands without scripts", async () => {
  const context = await browser.newContext({ javaScriptEnabled: false });
  const page = await context.newPage();
  await page.goto(`file://${report(200)}`);
  assert.equal(await page.isVisible("#explore"), false);
  assert.ok((await page.locator("figure svg").count()) >= 10);
  await context.close();
});

test("10,000 stones: size, first paint and memory", async () => {
  const { page, close } = await open(browser, report(10_000));
  const paint = await page.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0].startTime);
  const ready = await page.evaluate(() => performance.now());
  const memory = await page.evaluate(() => performance.memory.usedJSHeapSize);
  const size = statSync(report(10_000)).size;
  console.log(`10,000 stones: ${(size / 1e6).toFixed(1)} MB, first paint ${paint.toFixed(0)} ms, ready ${ready.toFixed(0)} ms, heap ${(memory / 1e6).toFixed(0)} MB`);
  assert.ok(size < 40e6, `${size} bytes`);
  // Times depend on the machine; these catch only a page that hangs.
  assert.ok(paint < 30_000 && ready < 60_000, `${paint} ${ready}`);
  assert.ok(memory < 400e6, `${memory} bytes`);
  await close();
});

test("the policy of the page forbids everything but its own program", () => {
  const html = readFileSync(report(200), "utf8");
  assert.match(html, /default-src 'none'; script-src 'nonce-[0-9a-f]{32}'/);
});
