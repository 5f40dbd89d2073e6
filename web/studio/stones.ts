// The stones: the face with outlines, a queue of those worth a look, corrections, and zones with thresholds.

import type { Report } from "../src/data.ts";
import { button, el } from "../src/dom.ts";
import { fixed } from "../src/format.ts";
import { Squares } from "../src/geometry.ts";
import { Photos } from "../src/views/photos.ts";
import { LANGUAGE } from "../src/texts.ts";
import type { Action, Change, Edit, EditsShown, ProjectShown, State, StoneChange } from "./api.ts";
import { changeList, countChanges } from "./changes.ts";
import { type Live, newId, Refused, server } from "./client.ts";
import { compared } from "./compared.ts";
import { type Area, Face, type Point, rectangle } from "./face.ts";
import { isAtWork, type Page } from "./page.ts";
import { loadReport } from "./report.ts";
import { sightingsOf } from "./sightings.ts";
import { teachingPanel } from "./teaching.ts";
import { type Word, tx } from "./texts.ts";

/** A stone whose points get less than this share of the photos' votes is worth a look. */
const AGREEMENT = 0.7;
/** A stone this many times larger or smaller than the median of the stones around it is worth a look. */
const UNLIKE = 5;
/** Stones within this many edges of the median stone of the wall are around one another. */
const AROUND = 4;
/** How far a stable area reaches in front of the surface and behind it, metres, unless somebody says otherwise. */
const MARGIN_M = "0.15";
/** Rows of the queue at most. */
const ROWS = 200;

/** The results that were shown last, to tell what a run changed. */
let last: { readonly version: string; readonly report: Report } | null = null;

export const stonesPage: Page = (place, live, until) => {
  const note = el("p", { class: "empty" }, tx("loadingStones"));
  place.append(note);
  let version: string | null | undefined, ends = new AbortController();
  until.addEventListener("abort", () => ends.abort());
  live.watch((state) => {
    if (state.report === version) return;
    // Results lie aside while a run works: the stones stay as they were.
    if (!state.report && version && state.run.phase === "running") return;
    version = state.report;
    ends.abort();
    ends = new AbortController();
    const mine = ends.signal, shown = version;
    if (!shown) {
      place.replaceChildren(note);
      note.textContent = tx("noResults");
      return;
    }
    void (async () => {
      const [report, edits, project] = await Promise.all([loadReport(), server.edits(), server.project()]);
      if (mine.aborted || !report) return;
      const room = new Room(report, shown, edits, project, live, mine);
      if (last && last.version !== shown) room.tell(compared(last.report, report));
      last = { version: shown, report };
      place.replaceChildren(el("h1", { class: "unseen" }, tx("stones")), room.element);
    })();
  }, until);
};

/** Acts whose author is not named yet, the oldest first: they outlive the page that they were drawn on. */
const kept: (readonly Edit[])[] = [];

/** Everything of the page for one state of the results. */
class Room {
  readonly element: HTMLElement;
  readonly #report: Report;
  readonly #live: Live;
  readonly #face: Face;
  readonly #photos: Photos;
  readonly #error = el("p", { class: "error", role: "alert", hidden: true });
  readonly #status = el("p", { class: "note", role: "status" });
  readonly #who = el("input", { type: "text", autocomplete: "name", value: localStorage.getItem("who") ?? "" });
  readonly #why = el("input", { type: "text", value: localStorage.getItem("why") ?? tx("whySeen") });
  readonly #list = el("ol", { class: "edits", tabindex: 0, "aria-label": tx("edits") });
  readonly #queue: readonly { readonly stone: number; readonly why: string }[];
  readonly #rows = new Map<number, HTMLButtonElement>();
  readonly #zones = el("ul", { class: "zones" });
  readonly #stable = el("ol", { class: "zones" });
  readonly #selection = el("div", { class: "selection" });
  readonly #outcome = el("section", { class: "outcome", hidden: true });
  readonly #undo: HTMLButtonElement;
  readonly #redo: HTMLButtonElement;
  readonly #apply: HTMLButtonElement;
  readonly #drawing: HTMLElement;
  /** When the results were written, milliseconds: later edits are not in them. */
  readonly #made: number;
  #edits: EditsShown;
  #project: ProjectShown;
  /** Stones that the last run changed, and those that another detector would change. */
  #applied: readonly StoneChange[] = [];
  #offered: readonly StoneChange[] = [];
  /** Acts are sent one after the other, in the order in which they were done. */
  #line: Promise<void> = Promise.resolve();

  constructor(report: Report, version: string, edits: EditsShown, project: ProjectShown, live: Live, until: AbortSignal) {
    this.#made = Number(version) / 1e6;
    this.#report = report;
    this.#edits = edits;
    this.#project = project;
    this.#live = live;
    this.#photos = new Photos(report);
    this.#face = new Face(report, this.#photos);
    this.#queue = queue(report);
    this.#undo = button(tx("undo"), tx("undoHint"), () => this.#step(server.undo));
    this.#redo = button(tx("redo"), tx("redoHint"), () => this.#step(server.redo));
    this.#apply = button(tx("apply"), tx("applyHint"), () => void this.#run());
    this.#apply.classList.add("primary");
    this.#drawing = el("div", { class: "drawing", hidden: true }, el("p", {}, tx("drawHelp")),
      button(tx("finish"), "", () => this.#face.finish()), button(tx("cancel"), "", () => this.#face.cancel()));
    // Messages lie over the wall: a line above it would move the wall under the pointer.
    const told = el("div", { class: "told" }, this.#status, this.#error);
    this.element = el("div", { class: "room" }, this.#toolbar(),
      el("div", { class: "work" },
        el("div", { class: "wall" }, this.#face.element, this.#drawing, told, this.#views()),
        this.#side(until)));
    this.#face.onSelect = () => this.#showSelection();
    this.#face.onDrawing = (isDrawing) => (this.#drawing.hidden = !isDrawing);
    document.addEventListener("keydown", (e) => this.#press(e), { signal: until });
    for (const [input, key] of [[this.#who, "who"], [this.#why, "why"]] as const) {
      input.addEventListener("input", () => localStorage.setItem(key, input.value));
    }
    this.#who.addEventListener("change", () => this.#sign());
    live.watch((state) => this.#told(state), until);
    this.#show();
    this.#showSelection();
  }

  /** Whether nothing can be changed: the page is only for looking, or the project of these results is gone. */
  get #isFixed(): boolean {
    const { view, has_project } = this.#live.state!;
    return view || !has_project;
  }

  #toolbar(): HTMLElement {
    const tool = (word: Word, hint: Word, press: () => void) => {
      const element = button(tx(word), tx(hint), press);
      element.disabled = this.#isFixed;
      return element;
    };
    return el("div", { class: "toolbar", role: "toolbar", "aria-label": tx("tools") },
      el("span", { class: "group" },
        tool("join", "joinHint", () => this.#join()),
        tool("split", "splitHint", () => this.#split()),
        tool("redraw", "redrawHint", () => this.#redraw()),
        tool("box", "boxHint", () => this.#box()),
        tool("add", "addHint", () => this.#outline("add")),
        tool("delete", "deleteHint", () => this.#delete()),
        tool("ignore", "ignoreHint", () => this.#outline("ignore")),
        tool("zone", "zoneHint", () => this.#zone()),
        tool("stableArea", "stableHint", () => this.#stableArea())),
      el("span", { class: "group" }, this.#undo, this.#redo),
      this.#apply);
  }

  /** What is shown behind the outlines, and how large. */
  #views(): HTMLElement {
    const names = this.#report.document.epochs;
    const choice = el("select", { "aria-label": tx("behind") }, ...names.map((name, n) => el("option", { value: n }, name)));
    choice.addEventListener("change", () => {
      this.#face.epoch = choice.value === "1" ? 1 : 0;
      this.#face.redraw();
    });
    return el("div", { class: "views-bar" }, choice,
      button("+", "+", () => this.#face.zoom(1.5)), button("−", "−", () => this.#face.zoom(1 / 1.5)),
      button("⤢", "Home", () => this.#face.whole()));
  }

  #side(until: AbortSignal): HTMLElement {
    const rows = this.#queue.slice(0, ROWS).map(({ stone, why }) => {
      const row = button(`${tx("stone", { id: this.#report.stones.id[stone]! })}: ${why}`, "", () => this.#face.choose(stone));
      this.#rows.set(stone, row);
      return el("li", {}, row);
    });
    return el("aside", {},
      this.#outcome,
      this.#selection,
      el("section", {}, el("h2", {}, `${tx("queue")} (${this.#queue.length})`),
        el("p", { class: "note" }, this.#queue.length > 0 ? tx("queueKeys") : tx("queueEmpty")),
        el("p", { class: "group" }, button(`◂ ${tx("previousInQueue")}`, "P", () => this.#walk(-1)), button(`${tx("nextInQueue")} ▸`, "N", () => this.#walk(1))),
        el("ol", { class: "queue", tabindex: 0, "aria-label": tx("queue") }, ...rows)),
      el("section", {}, el("h2", {}, tx("edits")),
        el("div", { class: "signed" }, el("label", {}, tx("who"), this.#who), el("label", {}, tx("why"), this.#why)),
        this.#list),
      el("section", {}, el("h2", {}, tx("zones")), this.#zones),
      el("section", {}, el("h2", {}, tx("stableAreas")), el("p", { class: "note" }, tx("stableNote")), this.#stable),
      teachingPanel(this.#live, {
        show: (changes) => {
          this.#offered = changes;
          this.#showChanges();
        },
        look: ({ outline }) => this.#face.look(outline),
      }, until));
  }

  /** Shows which stones the last run changed, until somebody puts it away. */
  tell(changes: readonly StoneChange[]): void {
    this.#applied = changes;
    const away = button(tx("hide"), "", () => {
      this.#outcome.hidden = true;
      this.#applied = [];
      this.#showChanges();
    });
    const { sentence } = this.#live.state!.run;
    this.#outcome.replaceChildren(el("h2", {}, tx("outcome")), ...(sentence ? [el("p", {}, sentence)] : []),
      el("p", { role: "status" }, changes.length > 0 ? tx("outcomeCount", countChanges(changes)) : tx("outcomeNone")),
      changeList(changes, tx("outcome"), ({ outline }) => this.#face.look(outline)), away);
    this.#outcome.hidden = false;
    this.#showChanges();
  }

  #showChanges(): void {
    this.#face.changes = [...this.#applied, ...this.#offered];
    this.#face.redraw();
  }

  #told(state: State): void {
    const isBusy = isAtWork(state), works = isBusy && state.run.job === "run";
    this.#apply.hidden = this.#isFixed;
    this.#apply.disabled = isBusy || !state.is_outdated;
    const { skipped } = state.run;
    this.#status.hidden = !works && skipped.length === 0;
    this.#status.textContent = works ? `${tx("applying")} ${state.run.steps.find((s) => s.state === "working")?.name ?? ""}` : skipped.map((s) => `${tx("skippedTitle")}: ${s}`).join(" ");
    if (state.run.error && state.run.job === "run") this.#fail(state.run.error);
  }

  /** Shows the edits and zones as they are. */
  #show(): void {
    const { edits, can_undo, can_redo } = this.#edits;
    this.#undo.disabled = this.#isFixed || !can_undo;
    this.#redo.disabled = this.#isFixed || !can_redo;
    const pending = edits.filter((edit) => Date.parse(edit.when) > this.#made);
    this.#face.pending = [...pending, ...kept.flat()];
    this.#list.replaceChildren(...[...edits].reverse().map((edit) =>
      el("li", {}, `${tx(`do_${edit.do}`)}, ${edit.who}, ${moment(edit.when)}: ${edit.why}`, pending.includes(edit) ? el("span", { class: "chip" }, tx("pending")) : null)));
    if (edits.length === 0) this.#list.replaceChildren(el("li", { class: "note" }, tx("noEdits")));
    const zones = zonesOf(this.#project);
    this.#face.zones = zones;
    this.#zones.replaceChildren(...zones.map((zone, n) =>
      el("li", {}, zone.name, this.#remove(tx("removeZone", { name: zone.name }), ["thresholds", "zones", n]))));
    if (zones.length === 0) this.#zones.replaceChildren(el("li", { class: "note" }, tx("noZones")));
    const { stable } = this.#project;
    this.#face.stable = stable.map(({ name, corners }, n) => ({ name: `${n + 1} ${name}`, polygon: rectangle(corners ?? []) }));
    this.#stable.replaceChildren(...stable.map(({ name, size_m }, n) => {
      const size = size_m.map((edge) => fixed(edge, 2)).join(" × ");
      return el("li", {}, `${name} (${size} m)`, this.#remove(tx("removeStable", { n: n + 1 }), ["registration", "stable", n]));
    }));
    if (stable.length === 0) this.#stable.replaceChildren(el("li", { class: "note" }, tx("noStable")));
    this.#face.redraw();
  }

  /** A button that takes an entry out of the project file. */
  #remove(hint: string, way: Change["way"]): HTMLButtonElement {
    const remove = button(tx("remove"), hint, () => void this.#take(server.change({ changes: [{ way, value: null }] })));
    remove.hidden = this.#isFixed;
    return remove;
  }

  #showSelection(): void {
    const chosen = [...this.#face.selected], { stones, document } = this.#report;
    for (const [stone, row] of this.#rows) {
      if (this.#face.selected.has(stone)) row.setAttribute("aria-current", "true");
      else row.removeAttribute("aria-current");
    }
    const list = chosen.map((i) => stones.id[i]!).join(", ");
    const head = el("h2", { "aria-live": "polite" }, chosen.length > 0 ? tx("selected", { list }) : tx("nothingSelected"));
    const [only] = chosen;
    if (chosen.length !== 1 || only === undefined) return this.#selection.replaceChildren(head);
    const status = document.statuses[stones.state[only]!];
    const facts = [`${fixed(stones.area[only]!, 3)} m²`, `${fixed(100 * stones.confidence[only]!, 0)} %`, status?.meaning ?? ""];
    const photos = this.#photos.of(only), { epochs } = this.#project;
    this.#selection.replaceChildren(head, el("p", { class: "note" }, facts.join(", ")), el("p", { class: "note" }, tx("selectMore")),
      ...(photos ? [el("h3", { class: "unseen" }, tx("stone", { id: stones.id[only]! })), photos] : []),
      ...(epochs.some((epoch) => epoch.photos > 0) ? [sightingsOf(stones.id[only]!, epochs, (message) => this.#fail(message))] : []));
  }

  /** Keys of the tools; not while somebody writes. */
  #press(e: KeyboardEvent): void {
    const target = e.target as HTMLElement;
    if (/^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName) || target.closest("dialog")) return;
    if ((e.ctrlKey || e.metaKey) && !e.altKey) {
      const key = e.key.toLowerCase();
      if (key === "z") (e.shiftKey ? this.#redo : this.#undo).click();
      else if (key === "y") this.#redo.click();
      else return;
      return e.preventDefault();
    }
    if (e.altKey || this.#isFixed) return;
    if (this.#face.isDrawing) {
      if (e.key === "Escape") this.#face.cancel();
      return;
    }
    const acts: Record<string, () => void> = {
      j: () => this.#join(), s: () => this.#split(), r: () => this.#redraw(), a: () => this.#outline("add"), b: () => this.#box(), i: () => this.#outline("ignore"),
      z: () => this.#zone(), t: () => this.#stableArea(), n: () => this.#walk(1), p: () => this.#walk(-1), Delete: () => this.#delete(),
      Escape: () => {
        this.#face.selected.clear();
        this.#showSelection();
        this.#face.redraw();
      },
    };
    const act = acts[e.key.length === 1 ? e.key.toLowerCase() : e.key];
    if (!act) return;
    e.preventDefault();
    act();
  }

  #walk(by: number): void {
    if (this.#queue.length === 0) return;
    const [only] = this.#face.selected;
    const now = this.#queue.findIndex(({ stone }) => stone === only);
    const next = now < 0 ? (by > 0 ? 0 : this.#queue.length - 1) : (now + by + this.#queue.length) % this.#queue.length;
    const { stone } = this.#queue[next]!;
    this.#face.choose(stone);
    this.#rows.get(stone)?.scrollIntoView({ block: "nearest" });
  }

  #join(): void {
    if (this.#face.selected.size < 2) return this.#fail(tx("needsTwo"));
    this.#add([{ ...this.#signed("merge"), at: this.#places() }]);
  }

  #delete(): void {
    if (this.#face.selected.size === 0) return this.#fail(tx("needsSelection"));
    this.#add([{ ...this.#signed("delete"), at: this.#places() }]);
  }

  #split(): void {
    this.#face.draw("line", (line) => this.#add([{ ...this.#signed("split"), line }]));
  }

  #outline(action: "add" | "ignore"): void {
    this.#face.draw("polygon", (outline) => this.#add([{ ...this.#signed(action), outline }]));
  }

  /** A stone of which only the box is drawn: the detector outlines it in the photos. */
  #box(): void {
    this.#face.draw("box", (box) => this.#add([{ ...this.#signed("add"), box }]));
  }

  /** Another border: the stone goes, and one with the new border comes. */
  #redraw(): void {
    if (this.#face.selected.size !== 1) return this.#fail(tx("needsSelection"));
    const at = this.#places();
    this.#face.draw("polygon", (outline) => this.#add([{ ...this.#signed("delete"), at }, { ...this.#signed("add"), outline }]));
  }

  #zone(): void {
    this.#face.draw("polygon", (polygon) => this.#ask(polygon));
  }

  /** Asks for the name and the thresholds of a zone. */
  #ask(polygon: Point[]): void {
    const [name, attention, alarm] = [text(""), number(""), number("")];
    this.#dialog(tx("zone"), [[tx("zoneName"), name], [tx("attention"), attention], [tx("alarm"), alarm]], () => {
      const [attention_mm, alarm_mm] = [read(attention), read(alarm)];
      if (!name.value.trim() || Number.isNaN(attention_mm) || Number.isNaN(alarm_mm)) return false;
      const value = { name: name.value.trim(), polygon, attention_mm, alarm_mm };
      void this.#take(server.change({ changes: [{ way: ["thresholds", "zones", zonesOf(this.#project).length], value }] }));
      return true;
    });
  }

  /** A part of the face that did not move; the server finds the surface behind the rectangle. */
  #stableArea(): void {
    this.#face.draw("box", (corners) => {
      const [name, margin] = [text(""), number(MARGIN_M)];
      this.#dialog(tx("stableArea"), [[tx("stableName"), name], [tx("margin"), margin]], () => {
        const margin_m = read(margin);
        if (margin_m === null || Number.isNaN(margin_m)) return false;
        void this.#take(server.stable({ name: name.value.trim(), corners: [corners[0]!, corners[1]!], margin_m }));
        return true;
      });
    });
  }

  /** Asks for what these fields hold; `save` says whether they hold it. */
  #dialog(title: string, fields: readonly (readonly [string, HTMLInputElement])[], save: () => boolean): void {
    const dialog = el("dialog", { "aria-label": title });
    const close = () => dialog.remove();
    const done = () => {
      if (save()) close();
    };
    const keep = button(tx("save"), "", done);
    keep.className = "primary";
    dialog.append(...fields.map(([label, input]) => el("label", {}, label, input)),
      el("p", { class: "group" }, keep, button(tx("cancel"), "", close)));
    dialog.addEventListener("close", close);
    dialog.addEventListener("keydown", (e) => {
      if (e.key === "Enter" && e.target instanceof HTMLInputElement) done();
    });
    this.element.append(dialog);
    dialog.showModal();
  }

  /** Places in the selected stones. */
  #places(): Point[] {
    const { a, u } = this.#report.stones;
    return [...this.#face.selected].map((i) => [a[i]!, u[i]!]);
  }

  #signed(action: Action): Edit {
    return { do: action, who: this.#who.value.trim(), when: "", why: this.#why.value.trim() };
  }

  #add(edits: readonly Edit[]): void {
    kept.push(edits);
    this.#face.selected.clear();
    this.#showSelection();
    this.#sign();
    if (kept.length === 0) return;
    this.#fail(tx("whoMissing"));
    this.#who.focus();
  }

  /** Sends what was done before its author was named, once that is so. */
  #sign(): void {
    const who = this.#who.value.trim();
    for (const edits of who ? kept.splice(0) : []) {
      const id = newId();
      this.#send(() => server.edit({ id, edits: edits.map((edit) => ({ ...edit, who })) }), edits);
    }
    this.#show();
  }

  #step(act: (id: string) => Promise<EditsShown>): void {
    const id = newId();
    this.#send(() => act(id));
  }

  /** Sends an act; what was drawn is kept where the server does not answer. */
  #send(act: () => Promise<EditsShown>, drawn?: readonly Edit[]): void {
    this.#line = this.#line.then(async () => {
      this.#error.hidden = true;
      try {
        this.#edits = await act();
        this.#show();
      } catch (error) {
        if (drawn && !(error instanceof Refused)) kept.push(drawn);
        this.#fail((error as Error).message);
      }
    });
  }

  /** Shows the project as a change leaves it. */
  async #take(change: Promise<ProjectShown>): Promise<void> {
    this.#error.hidden = true;
    try {
      this.#project = await change;
      this.#show();
    } catch (error) {
      this.#fail((error as Error).message);
    }
  }

  async #run(): Promise<void> {
    try {
      this.#live.take(await server.start());
    } catch (error) {
      this.#fail((error as Error).message);
    }
  }

  #fail(message: string): void {
    this.#error.textContent = message;
    this.#error.hidden = false;
  }
}

/** Stones that a person should look at, those of the gravest reasons first. */
function queue(report: Report): { stone: number; why: string }[] {
  const { stones, document } = report;
  const median = (areas: readonly number[]) => [...areas].sort((p, q) => p - q)[areas.length >> 1] ?? 0;
  const reach = AROUND * Math.sqrt(median(Array.from(stones.area).filter((area) => area > 0)));
  const squares = new Squares(reach || 1);
  for (let i = 0; i < stones.count; i++) {
    const [a, u] = [stones.a[i]!, stones.u[i]!];
    if (stones.area[i]! > 0) squares.add(i, a - reach, u - reach, a + reach, u + reach);
  }
  const found: { stone: number; why: string; weight: number }[] = [];
  for (let i = 0; i < stones.count; i++) {
    const reasons: string[] = [];
    let weight = 0;
    const status = document.statuses[stones.state[i]!];
    if (status && status.word !== "ok") {
      reasons.push(status.meaning);
      weight += 2;
    }
    if (stones.photos[i]! > 0 && stones.confidence[i]! < AGREEMENT) {
      reasons.push(tx("lowAgreement", { percent: fixed(100 * stones.confidence[i]!, 0) }));
      weight += 2 * (1 - stones.confidence[i]!);
    }
    const around = squares.at(stones.a[i]!, stones.u[i]!).filter((other) => other !== i);
    const usual = median(around.map((other) => stones.area[other]!));
    const ratio = usual > 0 ? stones.area[i]! / usual : 1;
    if (ratio > UNLIKE || ratio < 1 / UNLIKE) {
      reasons.push(tx("unlike", { times: fixed(ratio, ratio < 1 ? 2 : 1) }));
      weight += 1;
    }
    if (stones.photos[i] === 1 && reasons.length > 0) reasons.push(tx("fewPhotos"));
    if (reasons.length > 0) found.push({ stone: i, why: reasons.join("; "), weight });
  }
  return found.sort((p, q) => q.weight - p.weight);
}

/** A date with its time of day, where it has one, as people of this place write it. */
function moment(when: string): string {
  const isDay = when.length <= 10, date = new Date(isDay ? `${when}T00:00` : when);
  if (Number.isNaN(date.getTime())) return when;
  // The month in letters: 11/12 is another day on either side of the Atlantic.
  const place = ["en-GB", "de", "fr"][LANGUAGE];
  return date.toLocaleString(place, { dateStyle: "medium", ...(isDay ? {} : { timeStyle: "short" }) });
}

function text(value: string): HTMLInputElement {
  return el("input", { type: "text", value });
}

function number(value: string): HTMLInputElement {
  return el("input", { type: "text", inputmode: "decimal", value });
}

/** The number in a field, with a point or a comma; `null` where it is empty. */
function read({ value }: HTMLInputElement): number | null {
  const text = value.trim().replace(",", ".");
  return text ? Number(text) : null;
}

/** The zones of the project file. */
function zonesOf(project: ProjectShown): Area[] {
  const thresholds = (project.values as { thresholds?: { zones?: Area[] } } | null)?.thresholds;
  return thresholds?.zones ?? [];
}
