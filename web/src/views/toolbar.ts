// The controls above the views.

import type { Report } from "../data.ts";
import { button, el } from "../dom.ts";
import type { Quantity, QuantityKey } from "../quantities.ts";
import type { State, Store } from "../store.ts";
import { t } from "../texts.ts";

/** What the buttons of a view do. */
export interface Zoomable {
  zoom(by: number): void;
  whole(): void;
}

/** The controls; `current` gives the view that is shown. */
export function toolbar(report: Report, store: Store, quantities: readonly Quantity[], current: () => Zoomable): HTMLElement {
  const select = el("select", { id: "quantity" }, ...quantities.map((q) => el("option", { value: q.key }, q.label)));
  select.addEventListener("change", () => store.set({ quantity: select.value as QuantityKey }));
  const check = (text: string, key: "fade" | "arrows") => {
    const box = el("input", { type: "checkbox", ...(store.get()[key] ? { checked: true } : {}), id: key });
    box.addEventListener("change", () => store.set({ [key]: box.checked }));
    return el("label", {}, box, text);
  };
  const tab = (text: string, view: State["view"]) => {
    const element = button(text, "", () => store.set({ view }));
    element.id = `view-${view}`;
    return element;
  };
  const tabs = [tab(t("mapTab"), "map"), tab(t("sceneTab"), "scene")] as const;
  const draw = button(t("drawProfile"), t("drawProfileHint"), () =>
    store.set({ view: "map", tool: store.get().tool === "profile" ? "move" : "profile" }));
  draw.id = "draw-profile";
  const reflect = () => {
    const { view, tool } = store.get();
    tabs[0].setAttribute("aria-pressed", String(view === "map"));
    tabs[1].setAttribute("aria-pressed", String(view === "scene"));
    draw.setAttribute("aria-pressed", String(tool === "profile"));
  };
  store.on(reflect);
  reflect();
  const zoom = el("span", { class: "group" },
    button("+", t("zoomIn"), () => current().zoom(1.6)),
    button("\u2212", t("zoomOut"), () => current().zoom(1 / 1.6)),
    button(t("wholeWall"), "", () => current().whole()));
  return el("div", { class: "controls" }, el("span", { class: "group", role: "group", "aria-label": t("viewGroup") }, ...tabs),
    el("label", {}, t("show"), select), report.document.sound ? check(t("fade"), "fade") : null, check(t("arrows"), "arrows"),
    behind(report, store), search(report, store), draw, zoom);
}

/** Chooses the photos behind the map; `null` where the report has none. */
function behind(report: Report, store: Store): HTMLElement | null {
  const { crops, epochs } = report.document;
  const given = (["first", "later"] as const).filter((_, epoch) => crops[epoch] !== null);
  if (given.length === 0) return null;
  const options = given.map((value) => el("option", { value }, epochs[value === "first" ? 0 : 1]));
  const select = el("select", { id: "behind" }, el("option", { value: "none" }, t("noPhotos")), ...options);
  select.addEventListener("change", () => store.set({ view: "map", behind: select.value as State["behind"] }));
  return el("label", {}, t("photosBehind"), select);
}

/** Finds a stone by its number. */
function search(report: Report, store: Store): HTMLElement {
  const input = el("input", { type: "search", id: "search", inputmode: "numeric", size: 7, placeholder: t("number") });
  input.addEventListener("input", () => {
    const text = input.value.trim();
    const stone = text === "" ? undefined : report.indexOfId.get(Number(text));
    input.setAttribute("aria-invalid", String(text !== "" && stone === undefined));
    if (stone !== undefined) store.choose(stone);
  });
  return el("label", {}, t("searchStone"), input);
}
