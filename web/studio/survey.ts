// The survey: what lies in the folder, what the check found, and the project file as a form.

import { button, el } from "../src/dom.ts";
import type { EpochShown, FindingShown, ProjectShown, State } from "./api.ts";
import { type Live, Refused, server } from "./client.ts";
import { Form, type Schema } from "./form.ts";
import type { Page } from "./page.ts";
import { tx } from "./texts.ts";

export const surveyPage: Page = (place, live, until) => {
  const body = el("div", { class: "survey" }, el("p", { class: "note" }, tx("loading")));
  place.append(body);
  let version: string | null = null;
  const load = async () => {
    const [project, schema] = await Promise.all([server.project(), server.schema()]);
    if (!until.aborted) show(body, project, schema as Schema, live, until);
  };
  live.watch((state) => {
    const key = `${state.has_project} ${state.project_version}`;
    if (key === version) return;
    version = key;
    void load();
  }, until);
};

function show(body: HTMLElement, project: ProjectShown, schema: Schema, live: Live, until: AbortSignal): void {
  const state = live.state!;
  body.replaceChildren();
  if (!state.project_file) {
    body.append(el("p", { class: "empty" }, tx("projectGone")));
    return;
  }
  if (!state.has_project) {
    body.append(proposed(project, state));
    return;
  }
  const mistake = el("p", { class: "error", role: "alert" });
  const findings = el("section", { class: "findings" });
  const cards = el("div", { class: "cards" });
  body.append(
    mistake,
    el("section", {}, el("h2", {}, tx("epochs")), cards),
    findings,
    el("section", {}, el("h2", {}, tx("parameters")), el("p", { class: "note" }, state.project_file), parameters(project, schema, live)),
  );
  if (project.mistake) {
    const { message, line } = project.mistake;
    mistake.textContent = `${tx("mistakeInFile")}${line ? ` (${tx("inLine", { line })})` : ""}: ${message}`;
  } else mistake.hidden = true;
  let told = "";
  live.watch(({ check }) => {
    // The page is not made anew while somebody reads it.
    const key = JSON.stringify(check);
    if (key === told) return;
    told = key;
    cards.replaceChildren(...project.epochs.map((epoch, n) => card(epoch, n, check.findings)));
    tell(findings, check);
  }, until);
}

function proposed(project: ProjectShown, state: State): HTMLElement {
  const box = el("section", {}, el("h2", {}, tx("noProjectYet")));
  const error = el("p", { class: "error", role: "alert", hidden: true });
  if (project.mistake) {
    error.textContent = project.mistake.message;
    error.hidden = false;
  }
  box.append(error);
  if (!project.proposal) return box;
  const write = button(tx("writeProject"), "", async () => {
    try {
      await server.init();
    } catch (refused) {
      error.textContent = (refused as Error).message;
      error.hidden = false;
    }
  });
  write.className = "primary";
  write.hidden = state.view;
  box.append(el("p", {}, tx("proposal")), el("ul", {}, ...project.proposal.lines.map((l) => el("li", {}, l))),
    el("pre", { tabindex: 0 }, project.proposal.text), write);
  return box;
}

/** An epoch with its files, a photo, and what was found about it. */
function card(epoch: EpochShown, n: number, findings: readonly FindingShown[]): HTMLElement {
  const about = findings.filter((f) => f.epoch === epoch.name && f.weight !== "fine");
  return el("article", { class: "epoch" },
    epoch.has_picture ? el("img", { src: `/api/v1/epochs/${n}/picture`, alt: tx("pictureOf", { epoch: epoch.name }), loading: "lazy" }) : null,
    el("h3", {}, epoch.name, n === 0 ? el("span", { class: "chip" }, tx("reference")) : null),
    el("ul", {},
      el("li", {}, epoch.date ?? tx("noDate")),
      ...epoch.clouds.map((c) => el("li", {}, `${c.name} (${size(c.bytes)})`)),
      el("li", {}, epoch.photos > 0 ? tx("photosCount", { n: epoch.photos }) : tx("noPhotos")),
      el("li", {}, epoch.masks ? tx("masksFrom", { file: epoch.masks }) : tx("masksFound"))),
    ...about.map(finding));
}

function tell(box: HTMLElement, check: State["check"]): void {
  const ofAll = check.findings.filter((f) => f.epoch === "" && f.weight !== "fine");
  const fine = check.findings.filter((f) => f.weight === "fine");
  const isFine = check.is_done && !check.findings.some((f) => f.weight !== "fine" && f.weight !== "note");
  box.replaceChildren(
    el("h2", {}, tx("findings")),
    el("p", { class: "note", role: "status" }, check.is_running ? tx("checking") : check.error ?? (isFine ? tx("allFine") : "")),
    ...ofAll.map(finding),
  );
  if (fine.length > 0) {
    box.append(el("details", {}, el("summary", {}, tx("nFine", { n: fine.length })),
      el("ul", {}, ...fine.map((f) => el("li", {}, `${f.epoch || tx("allEpochs")}: ${f.text}`)))));
  }
  if (check.is_done) box.append(el("p", {}, el("a", { href: "/check", target: "_blank", rel: "noopener" }, tx("checkPictures"))));
}

function finding({ weight, text }: FindingShown): HTMLElement {
  return el("p", { class: `finding ${weight}` }, el("strong", {}, tx(weight)), ` ${text}`);
}

/** The form, and what was changed in it saved together. */
function parameters(project: ProjectShown, schema: Schema, live: Live): HTMLElement {
  const view = live.state!.view;
  const count = el("span", { class: "note", role: "status" });
  const error = el("p", { class: "error", role: "alert", hidden: true });
  const save = button(tx("save"), "", async () => {
    const changes = form.changes();
    if (!changes) return;
    error.hidden = true;
    try {
      // The page is shown anew when the state contains the new file.
      await server.change({ changes });
      count.textContent = tx("saved");
    } catch (refused) {
      if (!(refused instanceof Refused)) throw refused;
      if (form.show(refused.mistake)) return;
      error.textContent = refused.message;
      error.hidden = false;
    }
  });
  save.className = "primary";
  const discard = button(tx("discard"), "", () => box.replaceWith(parameters(project, schema, live)));
  const bar = el("div", { class: "savebar", hidden: true }, save, discard, count);
  const form = new Form(schema, project.values, view, (n) => {
    bar.hidden = n === 0;
    count.textContent = tx("nChanges", { n });
  });
  const box = el("div", {}, form.element, error, bar);
  return box;
}

function size(bytes: number): string {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let n = bytes, k = 0;
  while (n >= 1000 && k < units.length - 1) {
    n /= 1000;
    k += 1;
  }
  return `${k === 0 || n >= 100 ? Math.round(n) : n.toFixed(1)} ${units[k]}`;
}
