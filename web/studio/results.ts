// The report as it is, in a frame that reaches nothing of the studio.

import { el } from "../src/dom.ts";
import type { Page } from "./page.ts";
import { remarksPanel } from "./remarks.ts";
import { tx } from "./texts.ts";

export const resultsPage: Page = (place, live, until) => {
  const note = el("p", { class: "empty" });
  const outdated = el("p", { class: "banner soft", hidden: true }, tx("outdated"));
  const link = el("a", { href: "/report/report.html", target: "_blank", rel: "noopener", class: "own-tab" }, tx("ownTab"));
  let frame: HTMLIFrameElement | null = null, version: string | null | undefined;
  const said = el("div");
  place.append(outdated, note, link, said);
  live.watch((state) => {
    outdated.hidden = !(state.is_outdated && state.report);
    link.hidden = note.hidden = false;
    link.hidden = !state.report;
    note.hidden = Boolean(state.report);
    note.textContent = tx("noResults");
    if (state.report === version) return;
    version = state.report;
    if (version && !said.hasChildNodes()) void remarksPanel(state.view).then((panel) => said.replaceChildren(panel));
    frame?.remove();
    frame = null;
    if (!version) return;
    frame = el("iframe", { src: "/report/report.html", title: tx("reportFrame"), class: "report" });
    place.append(frame);
  }, until);
};
