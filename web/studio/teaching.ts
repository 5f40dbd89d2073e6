// A detector that learns from the corrections: trained, scored on blocks kept apart, and offered with what it would change.

import { button, el } from "../src/dom.ts";
import { fixed } from "../src/format.ts";
import type { StoneChange, Offer, ScoreShown, State } from "./api.ts";
import { changeList, countChanges } from "./changes.ts";
import { type Live, server } from "./client.ts";
import { isAtWork } from "./page.ts";
import { tx } from "./texts.ts";

/** Minutes of a training unless somebody says otherwise. */
const MINUTES = "20";

/** What the panel needs of the page around it. */
export interface Wall {
  /** Outlines the stones that would change. */
  readonly show: (changes: readonly StoneChange[]) => void;
  /** Brings one of them into view. */
  readonly look: (change: StoneChange) => void;
}

/** The panel; it follows the state until the signal ends it. */
export function teachingPanel(live: Live, wall: Wall, until: AbortSignal): HTMLElement {
  const error = el("p", { class: "error", role: "alert", hidden: true });
  const act = (call: () => Promise<unknown>) => async () => {
    error.hidden = true;
    try {
      await call();
    } catch (refused) {
      error.textContent = (refused as Error).message;
      error.hidden = false;
    }
  };
  const minutes = el("input", { type: "text", inputmode: "decimal", value: MINUTES });
  const start = button(tx("teachStart"), "", act(async () => live.take(await server.teach({ minutes: Number(minutes.value.trim().replace(",", ".")) }))));
  const stop = button(tx("stop"), "", act(async () => live.take(await server.stop())));
  const form = el("div", { class: "group" }, el("label", { class: "minutes" }, tx("minutes"), minutes), start);
  const works = el("div", { hidden: true });
  const said = el("p", { class: "note", role: "status" });
  const offered = el("div", { class: "offer" });
  let version: string | null | undefined;
  live.watch((state) => {
    const { run } = state, isTeaching = run.job === "teach";
    form.hidden = state.view || isAtWork(state);
    works.hidden = !(isTeaching && isAtWork(state));
    stop.hidden = state.view;
    stop.disabled = run.phase === "stopping";
    if (!works.hidden) works.replaceChildren(progress(state), stop);
    said.textContent = isTeaching && !isAtWork(state) ? tx(`teach_${run.phase}`) : "";
    if (isTeaching && run.error) said.textContent = run.error;
    const offer = state.offer ?? null;
    if (offer === version) return;
    version = offer;
    void (async () => {
      const shown = offer ? (await server.teaching()).offer : null;
      if (until.aborted || version !== offer) return;
      wall.show(shown?.changes ?? []);
      offered.replaceChildren(...(shown ? offerOf(shown, state.view, wall, act) : []));
    })();
  }, until);
  return el("section", { class: "teaching" }, el("h2", {}, tx("teach")), el("p", { class: "note" }, tx("teachNote")), form, works, said, error, offered);
}

/** What the training is at. */
function progress({ run: { steps, part } }: State): HTMLElement {
  const name = steps.find((step) => step.state === "working")?.name ?? "";
  const box = el("p", {}, tx("teachWorks", { step: name }));
  if (part.total > 0) box.append(el("progress", { max: part.total, value: Math.min(part.done, part.total), "aria-label": name }));
  return box;
}

function offerOf(offer: Offer, view: boolean, wall: Wall, act: (call: () => Promise<unknown>) => () => Promise<void>): HTMLElement[] {
  const percent = (share: number | null | undefined) => (share === null || share === undefined ? "–" : `${fixed(100 * share, 1)} %`);
  const row = (word: "scoreBefore" | "scoreAfter", { f1, recall, precision }: ScoreShown) =>
    el("tr", {}, el("th", { scope: "row" }, tx(word)), ...[f1, recall, precision].map((share) => el("td", {}, percent(share))));
  const head = el("tr", {}, el("td", {}), ...(["f1", "recall", "precision"] as const).map((word) => el("th", { scope: "col" }, tx(word))));
  const gain = offer.gain_interval ? tx("gain", { low: fixed(100 * offer.gain_interval[0], 1), high: fixed(100 * offer.gain_interval[1], 1) }) : tx("gainUnknown");
  const accept = button(tx("accept"), "", act(server.accept));
  accept.className = "primary";
  return [
    el("h3", {}, tx("offer")),
    el("p", { class: "note" }, tx("offerFacts", { minutes: fixed(offer.minutes, 1), steps: offer.steps, corrected: offer.corrected, kept: offer.kept })),
    el("table", { class: "scores" }, head, row("scoreBefore", offer.before), row("scoreAfter", offer.after)),
    el("p", {}, gain, " ", offer.is_better ? tx("gainShown") : tx("gainNotShown")),
    el("p", {}, offer.changes.length > 0 ? tx("changesCount", countChanges(offer.changes)) : tx("noChanges")),
    changeList(offer.changes, tx("offer"), wall.look),
    ...(view ? [] : [el("p", { class: "group" }, accept, button(tx("decline"), "", act(server.decline)))]),
  ];
}
