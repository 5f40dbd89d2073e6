// The report's data, out of its page: the studio shows the same stones and photos.

import { type Report, readReport } from "../src/data.ts";
import { el } from "../src/dom.ts";

/** Marks elements that were taken from the report's page. */
const TAKEN = "data-from-report";
/** An element of the report's page that holds data; no "<" is in them. */
const DATA = /<script type="(application\/json|text\/plain)" id="([\w-]+)">([^<]*)<\/script>/g;

/** Reads the report's data anew. The elements that hold them come into this page, where the report's views look for them. */
export async function loadReport(): Promise<Report | null> {
  const response = await fetch("/report/report.html");
  if (!response.ok) return null;
  document.querySelectorAll(`[${TAKEN}]`).forEach((element) => element.remove());
  for (const [, type, id, text] of (await response.text()).matchAll(DATA)) {
    document.body.append(el("script", { type: type!, id: id!, [TAKEN]: "" }, text!));
  }
  return readReport(document);
}
