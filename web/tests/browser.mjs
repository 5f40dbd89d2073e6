// One headless Chromium for all browser tests: Debian's, or the one that CHROMIUM names.
import { chromium } from "playwright-core";

/** Starts the browser; WebGL alone runs on SwiftShader (drawing the whole page on it takes seconds a frame). */
export function launch() {
  return chromium.launch({
    executablePath: process.env["CHROMIUM"] ?? "/usr/bin/chromium",
    args: ["--no-sandbox", "--enable-unsafe-swiftshader", "--enable-precise-memory-info"],
  });
}

/** Opens a report from disk and notes what goes wrong: errors on the console, and requests beyond the file itself. */
export async function open(browser, path, { width = 1440, height = 900, dark = false } = {}) {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme: dark ? "dark" : "light", reducedMotion: "reduce" });
  const page = await context.newPage();
  page.setDefaultTimeout(90_000);
  const trouble = [];
  page.on("console", (message) => {
    if (message.type() === "error") trouble.push(message.text());
  });
  page.on("pageerror", (error) => trouble.push(String(error)));
  page.on("request", (request) => {
    if (!request.url().startsWith("file://") && !request.url().startsWith("blob:")) trouble.push(`request: ${request.url()}`);
  });
  await page.goto(`file://${path}`);
  await page.waitForSelector("#explore[data-ready]");
  return { page, trouble, close: () => context.close() };
}
