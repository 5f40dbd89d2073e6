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
/** Folder of made reports (`200`, `10000`, `german` and `doubt`), to test without cargo. */
const given = process.env["REPORTS"];
let browser, folder = given;

before(async () => {
  browser = await launch();
  if (given) return;
  folder = mkdtempSync(join(tmpdir(), "stonewise-report-"));
  execFileSync("cargo", ["build", "-q", "-p", "stonewise-lab"], { cwd: root, stdio: "inherit" });
  const target = process.env["CARGO_TARGET_DIR"] ?? join(root, "target");
  for (const stones of [200, 10_000]) {
    execFileSync(join(target, "debug/lab"), ["sample-report", String(stones), join(folder, String(stones))]);
  }
  execFileSync(join(target, "debug/lab"), ["sample-report", "200", join(folder, "german"), "moved", "de"]);
  execFileSync(join(target, "debug/lab"), ["sample-report", "200", join(folder, "doubt"), "unconverged"]);
});

after(async () => {
  await browser?.close();
  if (!given) rmSync(folder, { recursive: true, force: true });
});

const report = (stones) => join(folder, String(stones), "report.html");

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

/** What axe-core finds in a page as it is. */
async function findings(page) {
  await page.evaluate(readFileSync(join(root, "web/node_modules/axe-core/axe.min.js"), "utf8"));
  const { violations } = await page.evaluate(() => axe.run(document, { resultTypes: ["violations"] }));
  return violations.flatMap((v) => v.nodes.map((n) => `${v.id}: ${n.target.join(" ")}`));
}

for (const [name, dark, width] of [["200", false, 1440], ["200", true, 390], ["german", false, 834]]) {
  test(`screen readers and keyboards find everything: ${name}, ${dark ? "dark" : "light"}, ${width} px`, async () => {
    const { page, close } = await open(browser, report(name), { width, dark });
    assert.deepEqual(await findings(page), [], "map");
    await page.click("#view-scene");
    await page.waitForSelector(".wall-scene canvas[data-drawn]", { timeout: 60_000 });
    assert.deepEqual(await findings(page), [], "3D");
    await page.click("#view-map");
    await page.$$eval("details", (all) => all.forEach((d) => (d.open = true)));
    await page.waitForSelector(".stone-list tbody tr");
    assert.deepEqual(await findings(page), [], "folded parts");
    // What is seen can be said: the name of a button is its text, unless that is a mere sign.
    const odd = await page.$$eval("button", (all) => all
      .filter((b) => /\p{L}/u.test(b.textContent) && b.hasAttribute("aria-label")).map((b) => b.outerHTML));
    assert.deepEqual(odd, []);
    await close();
  });
}

test("the largest motion is chosen from the start, and the whole wall is in view", async () => {
  const { page, close } = await open(browser, report(200));
  const stone = await page.textContent(".stone-panel h3");
  await page.click(".stone-list summary");
  assert.equal(stone, `Stone ${await page.textContent(".stone-list tbody tr:first-child a")}`);
  const fits = await page.$eval(".stone-panel", (e) => [e.scrollHeight > e.clientHeight, getComputedStyle(e).overflowY, e.tabIndex]);
  assert.deepEqual(fits, [true, "auto", 0]);
  await close();
});

test("the chosen stone keeps its colour in space", async () => {
  const { page, close } = await open(browser, report(200));
  await page.focus(".wall-map canvas");
  await page.keyboard.press("Escape");
  await page.click("#view-scene");
  const canvas = ".wall-scene canvas";
  await page.waitForSelector(`${canvas}[data-drawn]`, { timeout: 60_000 });
  const drawn = async (act) => {
    const frame = await page.getAttribute(canvas, "data-drawn");
    await act();
    await page.waitForFunction((f) => document.querySelector(".wall-scene canvas").dataset.drawn !== f, frame, { timeout: 60_000 });
    return page.$eval(canvas, (c) => {
      const copy = document.createElement("canvas");
      [copy.width, copy.height] = [c.width, c.height];
      const pen = copy.getContext("2d");
      pen.drawImage(c, 0, 0);
      return Array.from(pen.getImageData(0, 0, c.width, c.height).data);
    });
  };
  await drawn(() => page.selectOption("#clouds", "none"));
  const without = await drawn(() => page.uncheck(".scene-controls label:has-text('arrows') input"));
  const chosen = await drawn(() => page.fill("#search", "100"));
  let changed = 0;
  for (let i = 0; i < without.length; i += 4) {
    if ([0, 1, 2].some((k) => Math.abs(without[i + k] - chosen[i + k]) > 8)) changed++;
  }
  // An outline, not the face: far less than the stone's 1/200 of the wall, and more than nothing.
  assert.ok(changed > 50 && changed < without.length / 4 / 250, `${changed} of ${without.length / 4} pixels`);
  await close();
});

for (const name of ["200", "10000", "german"]) {
  test(`nothing reaches beyond the edge of a phone: ${name}`, async () => {
    const { page, close } = await open(browser, report(name), { width: 390, height: 844 });
    assert.equal(await page.evaluate(() => document.documentElement.scrollWidth), 390);
    await close();
  });
}

test("photos lie behind the map when they are asked for, those of either epoch", async () => {
  const { page, trouble, close } = await open(browser, report(200));
  const canvas = ".wall-map canvas";
  await page.waitForSelector(`${canvas}[data-behind=none]`);
  // Mean brightness in the middle of the chosen stone's surroundings: made-up crops of the second epoch are 20 levels lighter.
  const light = () => page.$eval(canvas, (c) => {
    const data = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
    let sum = 0;
    for (let i = 0; i < data.length; i += 4) sum += data[i + 1];
    return sum / (data.length / 4);
  });
  const seen = [await light()];
  for (const epoch of ["first", "later"]) {
    await page.selectOption("#behind", epoch);
    await page.waitForSelector(`${canvas}[data-behind=${epoch}]`, { timeout: 60_000 });
    seen.push(await light());
  }
  const [without, first, later] = seen;
  assert.ok(without > first + 10 && later > first + 3, `${seen}`);
  await page.selectOption("#behind", "none");
  await page.waitForSelector(`${canvas}[data-behind=none]`);
  assert.ok(Math.abs((await light()) - without) < 0.5);
  assert.deepEqual(trouble, []);
  await close();
});

test("a German report speaks German", async () => {
  const { page, trouble, close } = await open(browser, report("german"));
  assert.equal(await page.getAttribute("html", "lang"), "de");
  await page.click("#view-scene");
  await page.click("#view-map");
  await page.$$eval("details", (all) => all.forEach((d) => (d.open = true)));
  await page.waitForSelector(".stone-list tbody tr");
  const seen = await page.$$eval("#explore button, #explore label, #explore option, #explore h3, #explore h4, #explore th, h2, h3, figcaption, summary",
    (all) => all.map((e) => e.textContent.trim()));
  const english = seen.filter((text) => /\b(the|wall|stone|stones|show|motion|along|moved|above|below|measured|all|page|outline|points|limit)\b/i.test(text));
  assert.deepEqual(english, []);
  assert.match(await page.textContent(".stone-panel .numbers"), /\d,\d/);
  assert.deepEqual(trouble, []);
  await close();
});

test("of a run in doubt neither limits nor intervals are given", async () => {
  const { page, trouble, close } = await open(browser, report("doubt"));
  assert.equal(await page.locator("#fade").count(), 0);
  assert.equal(await page.locator("#quantity option[value=limit]").count(), 0);
  await page.click(".stone-panel button:text-is('level')");
  await page.waitForSelector(".profile .line");
  await page.click(".stone-list summary");
  await page.waitForSelector(".stone-list tbody tr");
  await page.fill("#search", "4");
  await page.waitForSelector(".tracks .note");
  assert.match(await page.textContent(".tracks"), /do not measure this stone: too few photos/);
  await page.fill("#search", "42");
  await page.waitForSelector(".tracks .photo-dot");
  assert.equal(await page.locator(".tracks .ellipse").count(), 0);
  const text = await page.textContent("#explore");
  for (const claim of ["\u00b1", "LoD", "95 %", "limit"]) assert.ok(!text.includes(claim), claim);
  assert.deepEqual(trouble, []);
  await close();
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

    test("a stone shows its photos with outlines, and its points before and after alignment", async () => {
      await page.fill("#search", "42");
      await page.waitForSelector(".photos canvas[data-drawn]");
      await page.waitForFunction(() => document.querySelectorAll(".photos canvas[data-drawn]").length === 2);
      for (const k of [0, 1]) assert.ok((await colours(page, `.photos figure:nth-child(${k + 1}) canvas`)) >= 6);
      const path = () => page.$eval(".sections .section-dots.b", (e) => e.getAttribute("d"));
      await page.waitForSelector(".sections .section-dots.b");
      const before = await path();
      await page.check("#aligned");
      await page.waitForFunction((d) => document.querySelector(".sections .section-dots.b").getAttribute("d") !== d, before);
      await page.uncheck("#aligned");
    });

    test("a stone shows the faces that were matched, and what clouds and photos say each alone", async () => {
      await page.fill("#search", "42");
      await page.waitForFunction(() => document.querySelectorAll(".tracks canvas[data-drawn='41']").length === 3);
      for (const k of [1, 2]) assert.ok((await colours(page, `.tracks figure:nth-child(${k}) canvas`)) >= 4);
      assert.equal(await page.locator(".tracks .photo-dot").count(), 12);
      assert.equal(await page.locator(".tracks .ellipse").count(), 12 + 3);
      assert.match(await page.textContent(".tracks table"), /clouds alone.*photos alone.*both/s);
      await page.fill("#search", String(stones - 1));
      await page.waitForSelector(".tracks table");
      // A long wall shows pictures of some stones only, and numbers of all.
      const pictures = await page.locator(".tracks canvas").count();
      assert.equal(pictures, stones === 200 ? 3 : 0);
      assert.equal((await page.textContent(".tracks")).includes("most conspicuous"), stones !== 200);
    });

    test("the list sorts, filters and leads to a stone", async () => {
      await page.click(".stone-list summary");
      const first = () => page.textContent(".stone-list tbody tr:first-child td:nth-child(7)");
      const largest = Number(await first());
      await page.click(".stone-list th:nth-child(7) button");
      assert.ok(Number(await first()) < largest);
      await page.selectOption(".stone-list select", "not measured");
      assert.match(await page.textContent(".stone-list tbody"), /unmatched|failed|unobservable/);
      await page.click(".stone-list tbody tr:first-child a");
      assert.match(await page.textContent(".stone-panel"), /Not measured/);
      await page.click(".stone-list summary");
    });

    test("a dot of the scatter plot and a stone of a printed map lead to the stone", async () => {
      for (const chart of ["svg[data-chart=in-plane]", "svg[data-map]"]) {
        await page.focus(".wall-map canvas");
        await page.keyboard.press("Escape");
        await page.locator(chart).first().scrollIntoViewIfNeeded();
        const box = await page.locator(chart).first().boundingBox();
        // Search outwards from the middle until a stone is hit.
        for (let k = 0; k < 200 && (await page.locator(".stone-panel h3").count()) === 0; k++) {
          const [r, t] = [k * 0.6, k * 2.4];
          await page.locator(chart).first().click({ position: { x: box.width * 0.5 + r * Math.cos(t), y: box.height * 0.45 + r * Math.sin(t) } });
        }
        assert.equal(await page.locator(".stone-panel h3").count(), 1, chart);
      }
    });

    test("the 3D view draws stones, cloud, arrows and cameras, and moves them", async () => {
      await page.click("#view-scene");
      await page.waitForSelector(".wall-scene canvas[data-drawn]", { timeout: 60_000 });
      await page.waitForSelector(".wall-scene[data-clouds='2']", { timeout: 60_000 });
      const canvas = ".wall-scene canvas";
      const drawn = async (act) => {
        const frame = await page.getAttribute(canvas, "data-drawn");
        await act();
        await page.waitForFunction((f) => document.querySelector(".wall-scene canvas").dataset.drawn !== f, frame, { timeout: 60_000 });
        return page.$eval(canvas, (c) => c.toDataURL());
      };
      assert.ok((await colours(page, canvas)) >= 6, "blank");
      const still = await drawn(() => page.selectOption("#clouds", "none"));
      const moved = await drawn(() => page.check("#moved"));
      assert.notEqual(still, moved);
      const cloud = await drawn(() => page.selectOption("#clouds", "after"));
      assert.notEqual(cloud, moved);
      const left = await drawn(() => page.click(".scene-controls >> text=left"));
      assert.notEqual(left, cloud);
      const joints = await drawn(() => page.selectOption("#quantity", "opening"));
      assert.notEqual(joints, left);
      await page.selectOption("#quantity", "out");
      await page.click("#view-map");
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
  await page.waitForFunction(() => performance.getEntriesByName("first-contentful-paint").length > 0);
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
