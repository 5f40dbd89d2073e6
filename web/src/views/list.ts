// All stones as a table to sort and filter, a page at a time.

import { type Report, isMeasured, norm } from "../data.ts";
import { button, el } from "../dom.ts";
import { count, fixed, percent, signed } from "../format.ts";
import type { Store } from "../store.ts";

const ROWS = 40;

interface Column {
  readonly title: string;
  /** What rows are sorted by; NaN comes last. */
  readonly value: (stone: number) => number;
  readonly text: (stone: number) => string;
}

const FILTERS = ["all", "moved", "above the limit", "loose", "below the limit", "not measured"] as const;

/** The folded list under the map. */
export function stoneList(report: Report, store: Store): HTMLElement {
  const { stones, document: { statuses, decimals } } = report;
  const mm = (metres: number) => fixed(metres * 1e3, decimals);
  const move = (title: string, axis: 0 | 1 | 2): Column => ({
    title, value: (i) => stones.move[axis][i]!, text: (i) => signed(stones.move[axis][i]! * 1e3, decimals),
  });
  const columns: readonly Column[] = [
    { title: "stone", value: (i) => stones.id[i]!, text: (i) => String(stones.id[i]) },
    { title: "along m", value: (i) => stones.a[i]!, text: (i) => fixed(stones.a[i]!, 2) },
    { title: "up m", value: (i) => stones.u[i]!, text: (i) => fixed(stones.u[i]!, 2) },
    move("d along mm", 0), move("d up mm", 1), move("d out mm", 2),
    { title: "length mm", value: (i) => norm(stones.move, i), text: (i) => mm(norm(stones.move, i)) },
    { title: "LoD95 mm", value: (i) => stones.limit[i]!, text: (i) => mm(stones.limit[i]!) },
    { title: "against neighbours mm", value: (i) => norm(stones.relative, i), text: (i) => mm(norm(stones.relative, i)) },
    { title: "rotation mrad", value: (i) => norm(stones.rotation, i), text: (i) => fixed(norm(stones.rotation, i) * 1e3, 2) },
    { title: "confidence", value: (i) => stones.confidence[i]!, text: (i) => percent(stones.confidence[i]!) },
    { title: "outcome", value: (i) => stones.state[i]!, text: (i) => statuses[stones.state[i]!]!.word },
  ];
  const passes: Record<string, (i: number) => boolean> = {
    all: () => true,
    "moved": (i) => stones.moved[i] === 1,
    "above the limit": (i) => stones.significant[i] === 1,
    "loose": (i) => stones.loose[i] === 1,
    "below the limit": (i) => isMeasured(stones, i) && !stones.significant[i],
    "not measured": (i) => !isMeasured(stones, i),
  };
  let sortBy = columns[6]!, descending = true, page = 0;
  const filter = el("select", {}, ...FILTERS.map((f) => el("option", { value: f }, f)));
  const body = el("div", { class: "scroll" }), pager = el("p", { class: "choices" });
  const rows = () => {
    const kept = Array.from({ length: stones.count }, (_, i) => i).filter(passes[filter.value]!);
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
      const sort = button(column.title + mark, `sort by ${column.title}`, () => {
        descending = column === sortBy ? !descending : column.title !== "stone";
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
    pager.replaceChildren(`${count(all.length)} stones, page ${page + 1} of ${pages} `,
      button("\u2190", "previous page", () => { page = Math.max(0, page - 1); draw(); }),
      button("\u2192", "next page", () => { page = Math.min(pages - 1, page + 1); draw(); }));
  };
  filter.addEventListener("change", () => { page = 0; draw(); });
  const element = el("details", { class: "stone-list" }, el("summary", {}, "List of all stones"),
    el("p", { class: "choices" }, el("label", {}, "Only ", filter)), body, pager);
  element.addEventListener("toggle", () => { if (element.open && !body.hasChildNodes()) draw(); });
  return element;
}
