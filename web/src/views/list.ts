// All stones as a table to sort and filter, a page at a time.

import { type Report, isMeasured, norm } from "../data.ts";
import { button, el } from "../dom.ts";
import { count, fixed, mm, percent, signedMm } from "../format.ts";
import type { Store } from "../store.ts";
import { t } from "../texts.ts";

const ROWS = 40;

interface Column {
  readonly title: string;
  /** What rows are sorted by; NaN comes last. */
  readonly value: (stone: number) => number;
  readonly text: (stone: number) => string;
}

const FILTERS = ["filterAll", "filterMoved", "filterAbove", "loose", "filterBelow", "unmeasured"] as const;
/** Those that a run in doubt can answer. */
const FILTERS_IN_DOUBT = ["filterAll", "unmeasured"] as const;

/** The folded list under the map. */
export function stoneList(report: Report, store: Store): HTMLElement {
  const { stones, document: { statuses, sound } } = report;
  const move = (title: string, axis: 0 | 1 | 2): Column => ({
    title, value: (i) => stones.move[axis][i]!, text: (i) => signedMm(stones.move[axis][i]!),
  });
  const limit: Column = { title: t("columnLimit"), value: (i) => stones.limit[i]!, text: (i) => mm(stones.limit[i]!) };
  const columns: readonly Column[] = [
    { title: t("columnStone"), value: (i) => stones.id[i]!, text: (i) => String(stones.id[i]) },
    { title: t("columnAlong"), value: (i) => stones.a[i]!, text: (i) => fixed(stones.a[i]!, 2) },
    { title: t("columnUp"), value: (i) => stones.u[i]!, text: (i) => fixed(stones.u[i]!, 2) },
    move(t("columnMoveAlong"), 0), move(t("columnMoveUp"), 1), move(t("columnMoveOut"), 2),
    { title: t("columnLength"), value: (i) => norm(stones.move, i), text: (i) => mm(norm(stones.move, i)) },
    ...(sound ? [limit] : []),
    { title: t("columnRelative"), value: (i) => norm(stones.relative, i), text: (i) => mm(norm(stones.relative, i)) },
    { title: t("columnRotation"), value: (i) => norm(stones.rotation, i), text: (i) => fixed(norm(stones.rotation, i) * 1e3, 2) },
    { title: t("columnConfidence"), value: (i) => stones.confidence[i]!, text: (i) => percent(stones.confidence[i]!) },
    { title: t("columnOutcome"), value: (i) => stones.state[i]!, text: (i) => statuses[stones.state[i]!]!.word },
  ];
  const passes: Record<(typeof FILTERS)[number], (i: number) => boolean> = {
    filterAll: () => true,
    filterMoved: (i) => stones.moved[i] === 1,
    filterAbove: (i) => stones.significant[i] === 1,
    loose: (i) => stones.loose[i] === 1,
    filterBelow: (i) => isMeasured(stones, i) && !stones.significant[i],
    unmeasured: (i) => !isMeasured(stones, i),
  };
  let sortBy = columns[6]!, descending = true, page = 0;
  const filter = el("select", {}, ...(sound ? FILTERS : FILTERS_IN_DOUBT).map((f) => el("option", { value: f }, t(f))));
  const body = el("div", { class: "scroll", tabindex: 0, role: "group", "aria-label": t("tableOfAll") }), pager = el("p", { class: "choices" });
  const rows = () => {
    const kept = Array.from({ length: stones.count }, (_, i) => i).filter(passes[filter.value as (typeof FILTERS)[number]]);
    const sign = descending ? -1 : 1;
    return kept.sort((p, q) => {
      const [a, b] = [sortBy.value(p), sortBy.value(q)];
      if (Number.isNaN(a) || Number.isNaN(b)) return Number(Number.isNaN(a)) - Number(Number.isNaN(b));
      return sign * (a - b) || p - q;
    });
  };
  const draw = () => {
    const all = rows(), pages = Math.max(1, Math.ceil(all.length / ROWS));
    page = Math.min(page, pages - 1);
    const head = columns.map((column) => {
      const mark = column === sortBy ? (descending ? " \u2193" : " \u2191") : "";
      const sort = button(column.title + mark, "", () => {
        descending = column === sortBy ? !descending : column !== columns[0];
        sortBy = column;
        draw();
      });
      return el("th", { scope: "col", "aria-sort": column === sortBy ? (descending ? "descending" : "ascending") : "none" }, sort);
    });
    const row = (i: number) => {
      const link = el("a", { href: "#explore" }, String(stones.id[i]));
      link.addEventListener("click", () => store.choose(i));
      return el("tr", {}, ...columns.map((column, k) => el("td", { class: "n" }, k === 0 ? link : column.text(i))));
    };
    body.replaceChildren(el("table", { class: "list" }, el("thead", {}, el("tr", {}, ...head)),
      el("tbody", {}, ...all.slice(page * ROWS, (page + 1) * ROWS).map(row))));
    pager.replaceChildren(t("page", { n: count(all.length), page: page + 1, pages }),
      button("\u2190", t("previousPage"), () => { page = Math.max(0, page - 1); draw(); }),
      button("\u2192", t("nextPage"), () => { page = Math.min(pages - 1, page + 1); draw(); }));
  };
  filter.addEventListener("change", () => { page = 0; draw(); });
  const element = el("details", { class: "stone-list" }, el("summary", {}, t("listOfAll")),
    el("p", { class: "choices" }, el("label", {}, t("only"), filter)), body, pager);
  element.addEventListener("toggle", () => { if (element.open && !body.hasChildNodes()) draw(); });
  return element;
}
