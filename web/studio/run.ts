// The run: its steps as a terminal shows them, started, stopped, continued.

import { button, el } from "../src/dom.ts";
import { fixed } from "../src/format.ts";
import type { PartShown, State, StepShown } from "./api.ts";
import { server } from "./client.ts";
import { isAtWork, type Page } from "./page.ts";
import { tx } from "./texts.ts";

const MARKS = { waiting: "·", working: "▸", done: "✓", earlier: "✓" } as const;

export const runPage: Page = (place, live, until) => {
  const error = el("p", { class: "error", role: "alert", hidden: true });
  const act = (call: () => Promise<State>) => async () => {
    error.hidden = true;
    try {
      live.take(await call());
    } catch (refused) {
      error.textContent = String((refused as Error).message);
      error.hidden = false;
    }
  };
  const start = button(tx("start"), "", act(server.start));
  start.className = "primary";
  const stop = button(tx("stop"), "", act(server.stop));
  const phase = el("p", { class: "phase", role: "status" });
  const sentence = el("p", { class: "sentence", hidden: true });
  const doubts = el("div", { class: "banner soft", hidden: true });
  const skipped = el("div", { class: "banner soft", hidden: true });
  const elsewhere = el("p", { class: "banner soft", hidden: true });
  const toResults = el("a", { href: "#results", class: "more", hidden: true }, tx("toResults"));
  const steps = el("ol", { class: "steps" });
  const lines = el("ul", { class: "lines" });
  const log = el("section", {}, el("h2", {}, tx("log")), lines);
  const folder = el("p", { class: "note" });
  place.append(
    el("div", { class: "acts" }, start, stop), phase, elsewhere, error, sentence, doubts, skipped, toResults,
    el("section", {}, el("h2", {}, tx("steps")), steps), log, folder, el("p", { class: "note" }, tx("runNote")),
  );
  live.watch((state) => {
    const { run } = state;
    const works = isAtWork(state);
    start.textContent = tx((run.phase === "stopped" && run.job === "run") || state.elsewhere ? "continue" : state.report ? "runAgain" : "start");
    start.hidden = works || state.view;
    start.disabled = !state.has_project;
    stop.hidden = !works || state.view;
    stop.disabled = run.phase === "stopping";
    const seconds = run.phase === "idle" ? "" : ` ${span(run.seconds)}`;
    const kind = run.job === "teach" ? "teach" : "phase";
    phase.textContent = tx(`${kind}_${run.phase}`) + (works ? "" : seconds);
    sentence.hidden = !run.sentence;
    sentence.textContent = run.sentence ?? "";
    toResults.hidden = run.phase !== "done" || run.job !== "run" || !state.report;
    doubts.hidden = run.doubts.length === 0;
    doubts.replaceChildren(el("strong", {}, tx("doubtsTitle")), el("ul", {}, ...run.doubts.map((d) => el("li", {}, d))));
    skipped.hidden = run.skipped.length === 0;
    skipped.replaceChildren(el("strong", {}, tx("skippedTitle")), el("ul", {}, ...run.skipped.map((d) => el("li", {}, d))));
    const other = run.phase === "idle" ? state.elsewhere ?? null : null;
    elsewhere.hidden = !other;
    phase.hidden = other !== null;
    if (other) elsewhere.textContent = other.steps.length > 0
      ? tx("elsewhereTold", { ago: span(other.seconds) })
      : tx("elsewhere", { n: other.finished, step: other.last_step ?? "", ago: span(other.seconds) });
    if (run.error) {
      error.textContent = run.error;
      error.hidden = false;
    }
    const told = other && other.steps.length > 0 ? other : run;
    steps.replaceChildren(...told.steps.map((step) => line(step, told.part)));
    steps.parentElement!.hidden = told.steps.length === 0;
    lines.replaceChildren(...run.lines.map((text) => el("li", {}, text)));
    log.hidden = run.lines.length === 0;
    folder.textContent = tx("resultsIn", { folder: state.results_folder });
  }, until);
};

function line(step: StepShown, part: PartShown): HTMLElement {
  const isNow = step.state === "working";
  const item = el("li", { class: step.state },
    el("span", { class: "mark", "aria-hidden": "true" }, MARKS[step.state]),
    el("span", { class: "name" }, step.name),
    el("span", { class: "time" }, step.state === "done" || isNow ? span(step.seconds) : tx(`step_${step.state}`)));
  if (isNow) {
    item.setAttribute("aria-current", "step");
    const words = [part.what, part.detail].filter((w) => w).join(", ");
    const count = part.total > 0 && part.total < 100_000 ? ` ${part.done}/${part.total}` : "";
    item.append(el("span", { class: "part" }, words + count));
    if (part.total > 0) item.append(el("progress", { max: part.total, value: Math.min(part.done, part.total), "aria-label": step.name }));
  }
  return item;
}

/** A span of time in words. */
function span(seconds: number): string {
  if (seconds < 60) return `${fixed(seconds, seconds < 9.95 ? 1 : 0)} s`;
  const whole = Math.round(seconds);
  return `${Math.floor(whole / 60)} min ${String(whole % 60).padStart(2, "0")} s`;
}
