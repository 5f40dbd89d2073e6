// The studio: a bar with the pages, and the page that the address names.

import { el } from "../src/dom.ts";
import type { State } from "./api.ts";
import { Live, server } from "./client.ts";
import { isAtWork, type Page } from "./page.ts";
import { resultsPage } from "./results.ts";
import { runPage } from "./run.ts";
import { stonesPage } from "./stones.ts";
import { surveyPage } from "./survey.ts";
import { tx } from "./texts.ts";
import "./studio.css";

const PAGES = { survey: surveyPage, run: runPage, stones: stonesPage, results: resultsPage } as const satisfies Record<string, Page>;
type Name = keyof typeof PAGES;

function start(root: HTMLElement): void {
  const lost = el("p", { class: "banner", role: "alert", hidden: true }, tx("connectionLost"));
  const live = new Live((isLost) => (lost.hidden = !isLost));
  const names = Object.keys(PAGES) as Name[];
  const links = new Map(names.map((name) => [name, el("a", { href: `#${name}` }, tx(name))]));
  const title = el("span", { class: "structure" });
  const progress = el("span", { class: "chip", hidden: true });
  const view = el("span", { class: "chip", hidden: true }, tx("viewOnly"));
  const outside = el("div", { class: "banner", role: "alert", hidden: true });
  const main = el("main", { id: "page", tabindex: -1 });
  root.append(
    el("header", { class: "bar" }, el("strong", {}, "stonewise"), title,
      el("nav", { "aria-label": tx("pages") }, ...links.values()), progress, view),
    lost, outside, main,
  );

  let shown: Name | null = null, ends = new AbortController();
  const show = () => {
    const asked = location.hash.slice(1);
    const name = names.find((n) => n === asked) ?? first(live.state);
    if (!name || name === shown) return;
    shown = name;
    ends.abort();
    ends = new AbortController();
    for (const [key, link] of links) {
      if (key === name) link.setAttribute("aria-current", "page");
      else link.removeAttribute("aria-current");
    }
    document.title = `${tx(name)} - ${tx("title")}`;
    main.replaceChildren(el("h1", { class: "unseen" }, tx(name)));
    main.className = `page-${name}`;
    PAGES[name](main, live, ends.signal);
  };
  window.addEventListener("hashchange", show);
  live.watch((state) => {
    title.textContent = structure(state);
    view.hidden = !state.view;
    if (outside.hidden === state.read_only) outside.replaceChildren(tx("projectOutside", { file: state.project_file ?? "" }), " ", allow());
    outside.hidden = !state.read_only;
    progress.hidden = !isAtWork(state);
    const ended = state.run.steps.filter((s) => s.state === "done" || s.state === "earlier").length;
    if (isAtWork(state)) progress.textContent = `${tx(state.run.job === "teach" ? "training" : "run")} ${ended}/${state.run.steps.length}`;
    if (!shown) show();
  }, new AbortController().signal);
}

/** A button that allows changes; the pages are made anew with their tools. */
function allow(): HTMLButtonElement {
  const button = el("button", { type: "button" }, tx("allowChanges"));
  button.addEventListener("click", () => {
    server.allow().then(() => location.reload()).catch((error: unknown) => (button.textContent = (error as Error).message));
  });
  return button;
}

/** The page to begin with: the results where there are some. */
function first(state: State | null): Name | null {
  if (!state) return null;
  if (state.run.phase === "running") return state.run.job === "run" ? "run" : "stones";
  return state.report && !state.is_outdated ? "results" : "survey";
}

/** The folder of the survey, short. */
function structure(state: State): string {
  const path = state.project_file ?? state.results_folder;
  const parts = path.split(/[\\/]/).filter((part) => part !== "stonewise.toml");
  return parts.at(-1) ?? path;
}

start(document.getElementById("studio")!);
