// One headless Chromium for all browser tests: Debian's, or the one that CHROMIUM names.
import { chromium } from "playwright-core";

/** Starts the browser; WebGL runs in software, so that any machine will do. */
export function launch() {
  return chromium.launch({
    executablePath: process.env["CHROMIUM"] ?? "/usr/bin/chromium",
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--enable-precise-memory-info"],
  });
}

/** Opens a report from disk and notes what goes wrong: errors on the console, and requests beyond the file itself. */
export async function open(browser, path, { width = 1440, height = 900, dark = false } = {}) {
  const context = await browser.newContext({ viewport: { width, height }, colorScheme: dark ? "dark" : "light" });
  const page = await context.newPage();
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
