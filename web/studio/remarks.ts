// What a person says of the results: remarks, a signature, the report on paper.

import { button, el } from "../src/dom.ts";
import type { RemarksShown } from "./api.ts";
import { server } from "./client.ts";
import { tx } from "./texts.ts";

const ABOUT = ["wall", "stone", "zone"] as const;

/** The panel beside the report; `view`: nothing can be changed. */
export async function remarksPanel(view: boolean): Promise<HTMLElement> {
  const error = el("p", { class: "error", role: "alert", hidden: true });
  const list = el("ul", { class: "remarks" });
  const signature = el("p", { class: "note" });
  const about = el("select", {}, ...ABOUT.map((what) => el("option", { value: what }, tx(`about_${what}`))));
  const number = el("input", { type: "number", min: 1, step: 1, required: true });
  const numbered = el("label", { hidden: true }, tx("number"), number);
  const text = el("textarea", { rows: 3, required: true, maxlength: 4000 });
  const who = el("input", { type: "text", autocomplete: "name", required: true, maxlength: 200, value: localStorage.getItem("who") ?? "" });
  const place = el("input", { type: "text", maxlength: 200, value: localStorage.getItem("place") ?? "" });
  about.addEventListener("change", () => (numbered.hidden = number.disabled = about.value === "wall"));
  number.disabled = true;
  who.addEventListener("input", () => localStorage.setItem("who", who.value));
  place.addEventListener("input", () => localStorage.setItem("place", place.value));

  const act = async (call: () => Promise<RemarksShown | void>): Promise<boolean> => {
    error.hidden = true;
    try {
      const shown = await call();
      if (shown) show(shown);
      return true;
    } catch (refused) {
      error.textContent = (refused as Error).message;
      error.hidden = false;
      return false;
    }
  };
  const show = ({ remarks, signature: signed }: RemarksShown): void => {
    list.replaceChildren(...remarks.map(({ said, when }) => {
      const subject = said.stone != null ? tx("stone", { id: said.stone }) : said.zone != null ? tx("zoneNumber", { id: said.zone }) : tx("wholeWall");
      const remove = button("✕", tx("removeRemark", { subject }), () => void act(() => server.unremark({ when })));
      return el("li", {}, el("b", {}, subject), `: ${said.text} `, el("small", {}, `${said.who}, ${day(when)}`), view ? null : remove);
    }));
    list.hidden = remarks.length === 0;
    const values = signed ? { who: signed.who, day: day(signed.when), at: [signed.place, day(signed.when)].filter((part) => part).join(", ") } : {};
    signature.textContent = tx(signed ? (signed.holds ? "signedBy" : "signedOthers") : "notSigned", values);
    unsign.hidden = view || !signed;
  };
  const unsign = button(tx("unsign"), "", () => void act(server.unsign));

  const remark = el("form", { class: "remark" },
    el("label", {}, tx("about"), about), numbered, el("label", { class: "wide" }, tx("remark"), text),
    el("button", { type: "submit" }, tx("addRemark")));
  remark.addEventListener("submit", (event) => {
    event.preventDefault();
    if (!who.reportValidity()) return;
    const id = about.value === "wall" ? null : Number(number.value);
    const said = { stone: about.value === "stone" ? id : null, zone: about.value === "zone" ? id : null, epoch: "", who: who.value.trim(), text: text.value.trim() };
    void act(() => server.remark(said)).then((done) => done && (text.value = ""));
  });
  const sign = button(tx("sign"), tx("signHint"), () => {
    if (who.reportValidity()) void act(() => server.sign({ who: who.value.trim(), place: place.value.trim() }));
  });
  const pdf = button(tx("pdf"), "", () => void act(async () => {
    pdf.disabled = true;
    try {
      const url = URL.createObjectURL(await server.pdf());
      el("a", { href: url, download: "report.pdf" }).click();
      setTimeout(() => URL.revokeObjectURL(url), 60_000);
    } finally {
      pdf.disabled = false;
    }
  }));
  const acts = el("div", { class: "acts" }, ...(view ? [] : [sign, unsign, pdf]));
  const names = el("div", { class: "signed" }, el("label", {}, tx("who"), who), el("label", {}, tx("place"), place));
  const panel = el("details", { class: "remarks-panel" }, el("summary", {}, tx("remarksAndSignature")),
    error, list, ...(view ? [] : [remark, names]), signature, acts);
  await act(server.remarks);
  return panel;
}

function day(when: string): string {
  return when.slice(0, 10);
}
