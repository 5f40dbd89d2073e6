// The studio in a real browser: from a folder of scans to corrected stones.
import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { cpSync, existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { launch } from "./browser.mjs";

const root = join(dirname(fileURLToPath(import.meta.url)), "../..");
const target = process.env["CARGO_TARGET_DIR"] ?? join(root, "target");
/** The program, to test without cargo. */
const program = process.env["STONEWISE"] ?? join(target, "debug/stonewise");
/** Folder for screenshots, where a person looks at them. */
const pictures = process.env["SCREENSHOTS"];

/** A wall of a few dozen stones with true masks, so that a run takes seconds. */
const SURVEY = `
name = "Test wall"
[scene]
seed = 3
[scene.wall]
width_m = 1.6
height_m = 1.0
seed = 3
[scene.tls]
spacing_m = 0.008
[photos]
columns = 2
rows = 1
width = 800
height = 600
focal_px = 1100.0
distance_m = 5.0
`;

let browser, folder;

before(async () => {
  browser = await launch();
  if (!process.env["STONEWISE"]) execFileSync("cargo", ["build", "-q", "-p", "stonewise-cli"], { cwd: root, stdio: "inherit" });
  folder = mkdtempSync(join(tmpdir(), "stonewise-studio-"));
  writeFileSync(join(folder, "params.toml"), SURVEY);
  execFileSync(program, ["test", "simulate", "--quiet", "--params", join(folder, "params.toml"), "--out", join(folder, "made")]);
});

after(async () => {
  await browser?.close();
  rmSync(folder, { recursive: true, force: true });
});

/** Starts a studio; its address, and how to end it. */
async function studio(place, ...options) {
  const child = spawn(program, ["studio", place, "--no-browser", ...options], { stdio: ["ignore", "pipe", "inherit"] });
  const address = await new Promise((found, failed) => {
    child.stdout.once("data", (data) => found(String(data).trim()));
    child.once("exit", () => failed(new Error("the studio ended")));
  });
  const end = () => new Promise((ended) => {
    child.removeAllListeners("exit");
    child.once("exit", ended);
    child.kill("SIGINT");
  });
  return { address, end, server: child.pid };
}

/** Opens a page and notes what goes wrong: errors on the console, and requests beyond the studio. */
async function open(address, { width = 1440, height = 900, dark = false, locale = "en-GB" } = {}) {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme: dark ? "dark" : "light", reducedMotion: "reduce", locale });
  const page = await context.newPage();
  page.setDefaultTimeout(120_000);
  const trouble = [];
  page.on("console", (message) => {
    // The browser reports a refused change on its console, too.
    if (message.type() === "error" && !message.text().includes("status of 422")) trouble.push(message.text());
  });
  page.on("pageerror", (error) => trouble.push(String(error)));
  const { origin } = new URL(address);
  page.on("request", (request) => {
    if (!request.url().startsWith(origin) && !/^(blob|data):/.test(request.url())) trouble.push(`request: ${request.url()}`);
  });
  await page.goto(address);
  await page.waitForSelector(".bar nav a[aria-current]");
  return { page, trouble, close: () => context.close() };
}

async function shot(page, name) {
  if (!pictures) return;
  mkdirSync(pictures, { recursive: true });
  await page.screenshot({ path: join(pictures, `${name}.png`) });
}

/** What axe-core finds in the page as it is, the report in its frame left out. */
async function findings(page) {
  await page.evaluate(readFileSync(join(root, "web/node_modules/axe-core/axe.min.js"), "utf8")).catch(() => {});
  const { violations } = await page.evaluate(() => axe.run({ exclude: [["iframe"]] }, { resultTypes: ["violations"], iframes: false }));
  return violations.flatMap((v) => v.nodes.map((n) => `${v.id}: ${n.target.join(" ")}`));
}

/** Clicks a stone on the canvas after it was brought into view by the queue or by its place. */
const canvas = (page) => page.locator(".face canvas");

test("the whole story: folder, project, run, report, corrections, zone, apply", async () => {
  const survey = join(folder, "survey");
  cpSync(join(folder, "made"), survey, { recursive: true });
  for (const made of ["stonewise.toml", "truth", "work", "simulation.toml"]) rmSync(join(survey, made), { recursive: true, force: true });
  const { address, end } = await studio(survey);
  const { page, trouble, close } = await open(address);

  // The folder, and the project that fits it.
  await page.waitForSelector("text=No project yet");
  assert.match(await page.textContent("pre"), /\[\[epochs\]\]/);
  await shot(page, "1-folder");
  await page.click("text=Write this project file");
  await page.waitForSelector(".epoch img");
  await page.waitForFunction(() => document.querySelector(".findings a[href='/check']"));
  assert.deepEqual(await findings(page), [], "survey");
  await shot(page, "2-survey");

  // A mistake is shown beside its field, a change is saved with the file's comments.
  await page.click("summary:has(code:text-is('match'))");
  const ratio = page.locator(".field:has(> label code:text-is('max_ratio'))");
  await ratio.locator("input").fill("-1");
  await page.click(".savebar >> text=Save");
  await ratio.locator(".error").filter({ hasText: "above 0" }).waitFor();
  await shot(page, "3-mistake");
  await ratio.locator("input").fill("");
  await page.locator(".field:has(> label code:text-is('date'))").nth(1).locator("input").fill("2026-04-01");
  await page.click(".savebar >> text=Save");
  await page.waitForSelector(".epoch:has-text('2026-04-01')");
  const text = readFileSync(join(survey, "stonewise.toml"), "utf8");
  assert.ok(text.includes("date = 2026-04-01") && text.startsWith("#:schema") && !text.includes("max_ratio"), text);

  // The run: stopped, continued, watched.
  await page.click("nav >> text=Run");
  await page.click("text=Start the run");
  await page.waitForSelector(".steps .working");
  await shot(page, "4-run");
  await page.click(".acts >> text=Stop");
  await page.waitForSelector("text=/was stopped|has finished/");
  await page.click(".acts button.primary");
  await page.waitForSelector("text=The run has finished");
  assert.deepEqual(await findings(page), [], "run");
  await shot(page, "5-done");

  // The report as it is.
  await page.click("text=Open the report");
  const report = page.frameLocator("iframe.report");
  await report.locator("#explore[data-ready]").waitFor();
  assert.deepEqual(await findings(page), [], "results");
  await shot(page, "6-results");

  // A remark, a signature, the report on paper.
  await page.click("summary:has-text('Remarks, signature, PDF')");
  const panel = page.locator(".remarks-panel");
  await panel.locator("textarea").fill("Looked at from the crest: sound.");
  await panel.locator(".signed label:first-child input").fill("A. Keller");
  await panel.locator(".signed label:last-child input").fill("Lower dam");
  await panel.locator("text=Add remark").click();
  await panel.locator(".remarks li:has-text('Wall: Looked at from the crest')").waitFor();
  await panel.locator("button:text-is('Sign')").click();
  await panel.locator("text=/Signed by A. Keller, Lower dam/").waitFor();
  await report.locator(".sign b:has-text('A. Keller')").waitFor();
  await report.locator(".remarks li:has-text('sound.')").waitFor();
  assert.deepEqual(await findings(page), [], "remarks");
  await shot(page, "6-signed");
  const [paper] = await Promise.all([page.waitForEvent("download"), panel.locator("text=Make the PDF").click()]);
  assert.equal(readFileSync(await paper.path()).subarray(0, 5).toString(), "%PDF-");

  // Corrections: join two, split one, draw one, take one back.
  await page.click("nav >> text=Stones");
  await page.waitForSelector(".face canvas[data-drawn]");
  await page.waitForFunction(() => document.querySelector(".face canvas").dataset.backdrop === "true");
  await shot(page, "7-stones");
  await page.fill(".signed label:first-child input", "A. Keller");
  const rows = () => readFileSync(join(survey, "results/stones.csv"), "utf8").trim().split("\n").length;
  const before = rows();
  const box = await canvas(page).boundingBox();
  const click = (x, y, modifiers = []) => canvas(page).click({ position: { x: x * box.width, y: y * box.height }, modifiers });
  await click(0.4, 0.5);
  await page.waitForSelector(".selection canvas");
  const first = await page.textContent(".selection h2");
  assert.match(first, /Selected: \d+$/);
  for (const x of [0.45, 0.5, 0.55, 0.6]) {
    await click(x, 0.5, ["Shift"]);
    if (/, \d+$/.test(await page.textContent(".selection h2"))) break;
  }
  await page.click(".toolbar >> text=Join");
  await page.waitForSelector(".edits >> text=joined");
  await page.click(".toolbar >> text=Add");
  await shot(page, "8-drawing");
  for (const [x, y] of [[0.1, 0.1], [0.2, 0.1], [0.2, 0.2]]) await click(x, y);
  await page.keyboard.press("Enter");
  await page.waitForSelector(".edits >> text=added");
  const takeBack = async () => {
    await page.keyboard.press("Control+z");
    await page.waitForFunction(() => !document.querySelector(".edits").textContent.includes("added"));
  };
  await takeBack();
  // A box has two corners.
  await page.keyboard.press("b");
  for (const [x, y] of [[0.1, 0.1], [0.2, 0.2]]) await click(x, y);
  await page.waitForSelector(".edits >> text=added");
  await shot(page, "8-box");
  await takeBack();

  // A zone with thresholds goes into the project file.
  await page.keyboard.press("z");
  for (const [x, y] of [[0.1, 0.1], [0.9, 0.1], [0.9, 0.5], [0.1, 0.5]]) await click(x, y);
  await page.keyboard.press("Enter");
  await page.fill("dialog label:nth-child(1) input", "crest");
  await page.fill("dialog label:nth-child(3) input", "5");
  await shot(page, "9-zone");
  await page.click("dialog >> text=Save");
  await page.waitForSelector(".zones >> text=crest");
  assert.match(readFileSync(join(survey, "stonewise.toml"), "utf8"), /\[\[thresholds\.zones\]\]\nname = "crest"/);

  // A stable area around the surface behind a rectangle, and one more that is taken away again.
  for (const [name, [left, top, right, bottom]] of [["gate", [0.1, 0.3, 0.45, 0.6]], ["ramp", [0.7, 0.7, 0.8, 0.8]]]) {
    await page.keyboard.press("t");
    for (const [x, y] of [[left, top], [right, bottom]]) await click(x, y);
    await page.fill("dialog label:nth-child(1) input", name);
    assert.equal(await page.inputValue("dialog label:nth-child(2) input"), "0.15");
    if (name === "gate") await shot(page, "9-stable");
    await page.click("dialog >> text=Save");
    await page.waitForSelector(`.zones >> text=${name}`);
  }
  await page.click("[title='Remove stable area 2']");
  await page.waitForFunction(() => !document.querySelector("aside").textContent.includes("ramp"));
  const project = readFileSync(join(survey, "stonewise.toml"), "utf8");
  const area = /\[\[registration\.stable\]\]\nname = "gate"\npolygon = (\[.*\])\nz = (\[.*\])\n/.exec(project);
  assert.ok(area && project.startsWith("#:schema") && !project.includes("ramp"), project);
  // Its sides are what was drawn, and as deep as the relief with both margins.
  const [[left, right, front], heights] = [JSON.parse(area[1]), JSON.parse(area[2])];
  const far = (p, q) => Math.hypot(p[0] - q[0], p[1] - q[1]);
  const deep = far(right, front), shape = far(left, right) / (heights[1] - heights[0]);
  assert.ok(deep > 0.3 && deep < 0.6, `${deep} m deep`);
  const drawn = (0.35 * box.width) / (0.3 * box.height);
  const [{ corners: [low, high] }] = (await page.evaluate(() => fetch("/api/v1/project").then((r) => r.json()))).stable;
  assert.ok(Math.abs((high[0] - low[0]) / (high[1] - low[1]) / drawn - 1) < 0.15, `${low} ${high}`);
  assert.ok(Math.abs(shape / drawn - 1) < 0.15, `${shape} ${drawn} ${area[0]}`);
  assert.deepEqual(await findings(page), [], "stones");
  await shot(page, "10-edited");

  // Apply repeats what the edits touch; the stones shown are those of the new results.
  await page.click(".toolbar >> text=Apply");
  await page.waitForSelector("text=Edits are being applied");
  await page.waitForFunction(() => document.querySelector(".toolbar .primary")?.disabled && !document.querySelector(".edits .chip"), null, { timeout: 120_000 });
  const audit = readFileSync(join(survey, "results/data/audit_edits.csv"), "utf8");
  assert.match(audit, /merge/);
  assert.equal(rows(), before - 1, audit);
  // What changed: one stone took in the other.
  await page.waitForSelector(".outcome >> text=/new 0, gone 1, other border 1/");
  assert.equal(await page.locator(".outcome li").count(), 2);
  assert.match(await page.textContent(".edits li"), /joined, A\. Keller, .*\d.*: /);
  await page.click(".outcome >> text=/other border: /");
  // Two clicks to a stone in every photo of every epoch.
  await click(0.4, 0.5);
  await page.click("text=Show it in every photo");
  await page.waitForFunction(() => [...document.querySelectorAll(".sightings img")].some((i) => i.complete && i.naturalWidth > 20));
  assert.ok((await page.locator(".sightings figure polygon").count()) >= 2);
  assert.deepEqual(await findings(page), [], "applied");
  await shot(page, "11-applied");
  assert.deepEqual(trouble, []);
  await close();
  await end();
});

/** Photos with light and shade, in which the detector finds stones. */
const PHOTOS = `
name = "Taught wall"
[scene]
seed = 3
[scene.wall]
width_m = 1.8
height_m = 1.2
seed = 3
[scene.tls]
spacing_m = 0.006
[photos]
columns = 2
rows = 2
width = 500
height = 400
focal_px = 900.0
distance_m = 5.0
rendered = true
`;

test("the detector learns from a correction, and changes nothing unseen", async () => {
  writeFileSync(join(folder, "photos.toml"), PHOTOS);
  const survey = join(folder, "taught");
  execFileSync(program, ["test", "simulate", "--quiet", "--params", join(folder, "photos.toml"), "--out", survey]);
  const file = join(survey, "stonewise.toml");
  writeFileSync(file, readFileSync(file, "utf8").replace(/^(masks|motion) *=.*\n/gm, ""));
  execFileSync(program, ["run", "--quiet", file, "--out", join(survey, "results"), "--force"]);
  const { address, end } = await studio(survey);
  const { page, trouble, close } = await open(address);
  page.setDefaultTimeout(400_000);
  await page.click("nav >> text=Stones");
  await page.waitForSelector(".face canvas[data-drawn]");
  await page.fill(".signed label:first-child input", "A. Keller");
  await page.keyboard.press("Tab");
  await canvas(page).focus();
  const box = await canvas(page).boundingBox();
  const click = (x, y, modifiers = []) => canvas(page).click({ position: { x: x * box.width, y: y * box.height }, modifiers });
  for (const x of [0.35, 0.4, 0.45, 0.5, 0.55, 0.6]) {
    await click(x, 0.5, ["Shift"]);
    if (/, \d+$/.test(await page.textContent(".selection h2"))) break;
  }
  await page.click(".toolbar >> text=Join");
  await page.waitForSelector(".edits >> text=joined");

  // Trained, stopped, continued.
  const panel = page.locator(".teaching");
  await panel.locator("input").fill("0");
  await panel.locator("button:text-is('Train')").click();
  await panel.locator(".error >> text=minutes must lie above 0").waitFor();
  await panel.locator("input").fill("0.2");
  await panel.locator("button:text-is('Train')").click();
  await panel.locator("text=At work: training").waitFor();
  await shot(page, "13-training");
  await panel.locator("text=Stop").click();
  await panel.locator("text=The training was stopped").waitFor();
  await panel.locator("button:text-is('Train')").click();
  await panel.locator(".scores").waitFor();
  assert.match(await panel.locator(".scores").textContent(), /before\d+\.\d %.*after\d+\.\d %/);
  assert.match(await panel.textContent(), /It would change/);
  assert.deepEqual(await findings(page), [], "offer");
  await panel.scrollIntoViewIfNeeded();
  await shot(page, "14-offer");
  const before = readFileSync(file, "utf8");
  assert.ok(!before.includes("[segment]") && !before.includes("detector/"), before);

  // Narrow, and still there after the studio has ended.
  await page.setViewportSize({ width: 390, height: 844 });
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), "the offer is wider than the screen");
  await panel.locator("h3").scrollIntoViewIfNeeded();
  await shot(page, "14-offer-narrow");
  await close();
  await end();
  const later = await studio(survey);
  const again = await open(later.address);
  await again.page.click("nav >> text=Stones");
  await again.page.click(".teaching >> text=Use this detector");
  await again.page.waitForSelector(".teaching .scores", { state: "detached" });
  const [, model] = /\[segment\]\nmodel = "(detector\/taught-[0-9a-f]+\.safetensors)"/.exec(readFileSync(file, "utf8")) ?? [];
  assert.ok(model && readFileSync(join(survey, model)).length > 1e6, model);
  assert.deepEqual([...trouble, ...again.trouble], []);
  await again.close();
  await later.end();
});

test("existing results open within a second, also narrow, dark and in German", async () => {
  const began = performance.now();
  const { address, end } = await studio(join(folder, "survey/results"), "--view");
  const { page, trouble, close } = await open(address, { width: 390, height: 844, dark: true, locale: "de-DE" });
  const seconds = (performance.now() - began) / 1e3;
  console.log(`start to page: ${seconds.toFixed(2)} s`);
  assert.ok(seconds < 5, `${seconds} s`);
  assert.equal(await page.evaluate(() => document.documentElement.lang), "en", "the project is English");
  for (const name of ["Survey", "Run", "Stones", "Results"]) {
    await page.click(`nav >> text=${name}`);
    if (name === "Stones") {
      await page.waitForSelector(".face canvas[data-drawn]");
      assert.ok(await page.isDisabled(".toolbar >> text=Join"), "nothing can be changed");
    }
    if (name === "Survey") await page.waitForSelector(".epoch");
    assert.deepEqual(await findings(page), [], name);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), `${name} is wider than the screen`);
    await shot(page, `narrow-${name}`);
  }
  assert.deepEqual(trouble, []);
  await close();
  const tablet = await open(address, { width: 1024, height: 768 });
  for (const name of ["Survey", "Stones", "Results"]) {
    await tablet.page.click(`nav >> text=${name}`);
    await tablet.page.waitForTimeout(600);
    await shot(tablet.page, `tablet-${name}`);
  }
  await tablet.close();
  await end();
});

/** Frames a second while a script moves the wall for three seconds; `move` is the body of a function of the canvas and the number of the frame. */
function frames(page, move) {
  return page.evaluate(async (body) => {
    const canvas = document.querySelector(".face canvas"), act = new Function("canvas", "n", body);
    const began = performance.now();
    let n = 0;
    for (; performance.now() - began < 3000; n++) {
      act(canvas, n);
      await new Promise(requestAnimationFrame);
    }
    return (1e3 * n) / (performance.now() - began);
  }, move);
}

const POINTER = `const box = canvas.getBoundingClientRect(), x = box.left + box.width / 2, y = box.top + box.height / 2;
  const send = (kind, dx, dy) => canvas.dispatchEvent(new PointerEvent(kind, { pointerId: 1, clientX: x + dx, clientY: y + dy }));`;
const PAN = `${POINTER} canvas.setPointerCapture = () => {}; if (n === 0) send("pointerdown", 0, 0); send("pointermove", 200 * Math.sin(n / 25), 60 * Math.sin(n / 40));`;
const ZOOM = `${POINTER} if (n === 0) send("pointercancel", 0, 0);
  canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: Math.sin(n / 30) > 0 ? -20 : 20, clientX: x, clientY: y, cancelable: true }));`;

test("ten thousand stones of results whose project is gone: first view, frames, memory", async () => {
  const large = join(folder, "large"), lab = process.env["LAB"] ?? join(target, "debug/lab");
  if (!process.env["LAB"]) execFileSync("cargo", ["build", "-q", "-p", "stonewise-lab"], { cwd: root, stdio: "inherit" });
  execFileSync(lab, ["sample-report", "10000", large, "moved"]);
  const { address, end, server } = await studio(large);
  const { page, trouble, close } = await open(address);
  const began = performance.now();
  await page.click("nav >> text=Stones");
  await page.waitForSelector(".face canvas[data-drawn]");
  const outlines = performance.now() - began;
  const still = () => page.waitForSelector(".face canvas[data-backdrop=true]");
  await still();
  console.log(`10,000 stones: outlines after ${(outlines / 1e3).toFixed(1)} s, photos after ${((performance.now() - began) / 1e3).toFixed(1)} s`);
  assert.ok(await page.isDisabled(".toolbar >> text=Join"), "nothing can be changed without the project");

  // There and back, the wall looks as before.
  const picture = () => page.$eval(".face canvas", (shown) => shown.toDataURL());
  await canvas(page).focus();
  await page.keyboard.press("Home");
  await still();
  const before = await picture();
  for (const key of ["ArrowRight", "ArrowUp", "+", "ArrowLeft", "Home"]) await page.keyboard.press(key);
  await page.waitForTimeout(300);
  await still();
  assert.ok(before === (await picture()), "the wall looks different after it was moved");

  for (const [times, presses] of [["1", 0], ["3.4", 3], ["11", 6]]) {
    await page.keyboard.press("Home");
    for (let n = 0; n < presses; n++) await page.keyboard.press("+");
    await page.waitForTimeout(300);
    await still();
    const [pan, zoom] = [await frames(page, PAN), await frames(page, ZOOM)];
    console.log(`${times} times as large as the whole wall: ${pan.toFixed(0)} frames a second while panning, ${zoom.toFixed(0)} while zooming`);
    assert.ok(Math.min(pan, zoom) > 25, `${pan} ${zoom}`);
  }
  const heap = await page.evaluate(() => performance.memory.usedJSHeapSize);
  const resident = existsSync(`/proc/${server}/status`) ? /VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${server}/status`, "utf8"))[1] / 1e3 : NaN;
  console.log(`memory: ${(heap / 1e6).toFixed(0)} MB of JavaScript, ${resident.toFixed(0)} MB of the studio`);
  assert.ok(heap < 500e6);
  assert.deepEqual(trouble, []);
  await close();
  await end();
});

test("a run that was started in a terminal is told, and shares its lock", async () => {
  const survey = join(folder, "elsewhere");
  cpSync(join(folder, "made"), survey, { recursive: true });
  const run = spawn(program, ["run", "--quiet", join(survey, "stonewise.toml"), "--out", join(survey, "results")], { stdio: "ignore" });
  const ended = new Promise((done) => run.once("exit", done));
  const { address, end } = await studio(survey);
  const { page, close } = await open(address);
  await page.click("nav >> text=Run");
  await page.waitForSelector("text=A run that was started elsewhere");
  await page.waitForSelector(".steps .working");
  assert.ok((await page.locator(".steps li").count()) > 5);
  await page.click(".acts button.primary");
  await page.waitForSelector("text=another run works in this folder");
  await shot(page, "12-elsewhere");
  await ended;
  await page.waitForSelector("text=A run that was started elsewhere", { state: "hidden" });
  await close();
  await end();
});
