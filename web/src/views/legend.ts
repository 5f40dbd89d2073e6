// The colour bar of the quantity on show, and what the marks mean.

import type { Report } from "../data.ts";
import { el } from "../dom.ts";
import { fixed } from "../format.ts";
import { OUTCOME_COLOURS, Palette, type Quantity } from "../quantities.ts";
import type { Store } from "../store.ts";
import { t } from "../texts.ts";

/** The legend, which follows the store. */
export function legend(report: Report, store: Store, quantities: readonly Quantity[]): HTMLElement {
  const element = el("div", { class: "map-legend" });
  const draw = () => {
    const { quantity: key, fade } = store.get();
    const quantity = quantities.find((q) => q.key === key)!;
    const marks: Node[] = quantity.scale === "outcomes" ? outcomes(report) : [bar(report, quantity)];
    if (quantity.fades && fade) marks.push(mark("pale", t("belowMark")));
    if (quantity.scale !== "outcomes" && quantity.key !== "opening") marks.push(mark("hatched", t("unmeasured")));
    if (report.document.sound) marks.push(mark("ring", t("loose")));
    element.replaceChildren(...marks, el("span", { class: "note" }, quantity.note));
  };
  store.on((state, before) => {
    if (state.quantity !== before.quantity || state.fade !== before.fade) draw();
  });
  draw();
  return element;
}

function bar(report: Report, quantity: Quantity): Node {
  const colours = new Palette(report, quantity).colours;
  const stripe = el("i", { class: "stripe" });
  stripe.style.background = `linear-gradient(90deg, ${colours.join(", ")})`;
  const end = fixed(quantity.limit, quantity.limit < 1 ? 2 : quantity.limit < 10 && quantity.limit % 1 ? 1 : 0);
  const [low, high] = quantity.scale === "diverging" ? [`\u2212${end}`, `+${end}`] : [fixed(quantity.start ?? 0, 0), end];
  return el("span", { class: "colour-bar" }, el("b", {}, quantity.label), low, stripe, `${high} ${quantity.unit}`);
}

function mark(kind: string, text: string): Node {
  return el("span", {}, el("i", { class: `key ${kind}` }), text);
}

function outcomes(report: Report): Node[] {
  const present = new Set(Array.from(report.stones.state));
  return report.document.statuses.flatMap((status, i) => {
    if (!present.has(i)) return [];
    const key = el("i", { class: "key" });
    key.style.background = OUTCOME_COLOURS[i]!;
    return [el("span", { title: status.meaning }, key, status.word)];
  });
}
