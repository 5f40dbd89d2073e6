// A form for the project file, made from its schema: units, defaults, one sentence about each key, errors beside the field.

import { el } from "../src/dom.ts";
import type { Change, MistakeShown, Step } from "./api.ts";
import { tx } from "./texts.ts";

/** The parts of a JSON schema (draft 7) that the project's schema uses. */
export interface Schema {
  readonly type?: string;
  readonly description?: string;
  readonly default?: unknown;
  readonly enum?: readonly unknown[];
  readonly oneOf?: readonly Schema[];
  readonly const?: unknown;
  readonly items?: Schema;
  readonly properties?: Readonly<Record<string, Schema>>;
  readonly required?: readonly string[];
  readonly "x-unit"?: string;
  readonly minimum?: number;
  readonly maximum?: number;
}

/** Keys that come first, in this order; all others follow as the schema lists them. */
const FIRST = ["project", "epochs", "thresholds", "report", "edits", "name", "date", "clouds", "images", "cameras", "masks", "attention_mm", "alarm_mm"];

/** What a person typed, or why it cannot be. */
type Typed = { readonly value: unknown } | { readonly error: string };

/** A form with what was changed in it. */
export class Form {
  readonly element = el("div", { class: "form" });
  readonly #changes = new Map<string, Typed>();
  readonly #fields = new Map<string, { readonly input: HTMLElement; readonly error: HTMLElement }>();
  readonly #changed: (count: number) => void;
  readonly #readOnly: boolean;
  #count = 0;

  constructor(schema: Schema, values: unknown, readOnly: boolean, changed: (count: number) => void) {
    this.#changed = changed;
    this.#readOnly = readOnly;
    for (const [key, inner] of ordered(schema.properties ?? {})) {
      const isOpen = key === "project" || key === "epochs";
      const part = el("details", isOpen ? { open: true } : {}, el("summary", {}, el("code", {}, key), about(inner)));
      part.append(this.#any(inner, at(values, key), [key], key));
      this.element.append(part);
    }
  }

  /** The changes, or `null` where something was typed that cannot be. */
  changes(): Change[] | null {
    const changes: Change[] = [];
    for (const [way, typed] of this.#changes) {
      if ("error" in typed) return null;
      changes.push({ way: JSON.parse(way) as Step[], value: typed.value });
    }
    return changes;
  }

  /** Shows a mistake beside the field it is about; `false` where there is none. */
  show(mistake: MistakeShown): boolean {
    const way = [...mistake.way];
    while (way.length > 0) {
      const field = this.#fields.get(JSON.stringify(way));
      if (field) {
        this.#tell(JSON.stringify(way), mistake.message);
        for (let parent = field.input.parentElement; parent; parent = parent.parentElement) {
          if (parent instanceof HTMLDetailsElement) parent.open = true;
        }
        field.input.focus();
        field.error.scrollIntoView({ block: "center" });
        return true;
      }
      way.pop();
    }
    return false;
  }

  #any(schema: Schema, value: unknown, way: Step[], name: string): HTMLElement {
    if (schema.properties) {
      const box = el("div", { class: "keys" });
      for (const [key, inner] of ordered(schema.properties)) {
        const here = [...way, key];
        if (inner.properties || isTables(inner)) {
          box.append(el("fieldset", {}, el("legend", {}, el("code", {}, key), about(inner)), this.#any(inner, at(value, key), here, key)));
        } else box.append(this.#field(key, inner, at(value, key), here));
      }
      return box;
    }
    if (isTables(schema)) {
      const list = Array.isArray(value) ? value : [];
      const box = el("div", { class: "entries" });
      list.forEach((entry, n) => {
        const title = tx("entry", { name: singular(name), n: n + 1 });
        box.append(el("fieldset", {}, el("legend", {}, title), this.#any(schema.items!, entry, [...way, n], name)));
      });
      return box;
    }
    return this.#field(name, schema, value, way);
  }

  #field(name: string, schema: Schema, value: unknown, way: Step[]): HTMLElement {
    const key = JSON.stringify(way), id = `field-${this.#count++}`;
    const control = input(schema, value);
    control.element.id = id;
    if (this.#readOnly) control.element.setAttribute("disabled", "");
    const error = el("p", { class: "error", id: `${id}-error`, hidden: true });
    control.element.setAttribute("aria-describedby", `${id}-about ${id}-error`);
    this.#fields.set(key, { input: control.element, error });
    const start = JSON.stringify(value ?? null);
    control.element.addEventListener("input", () => {
      const typed = control.read();
      this.#tell(key, "error" in typed ? typed.error : "");
      if ("value" in typed && JSON.stringify(typed.value ?? null) === start) this.#changes.delete(key);
      else this.#changes.set(key, typed);
      this.#changed(this.#changes.size);
    });
    const unit = schema["x-unit"];
    return el("div", { class: "field" },
      el("label", { for: id }, el("code", {}, name)),
      el("span", { class: "input" }, control.element, unit ? el("span", { class: "unit" }, unit) : null),
      el("p", { class: "note", id: `${id}-about` }, [about(schema).trim(), control.hint].filter((w) => w).join(" ")),
      error);
  }

  #tell(key: string, message: string): void {
    const field = this.#fields.get(key);
    if (!field) return;
    field.error.textContent = message;
    field.error.hidden = !message;
    if (message) field.input.setAttribute("aria-invalid", "true");
    else field.input.removeAttribute("aria-invalid");
  }
}

interface Control {
  readonly element: HTMLInputElement | HTMLSelectElement | HTMLTextAreaElement;
  readonly hint: string;
  readonly read: () => Typed;
}

/** The control for a value; empty means that the file has none. */
function input(schema: Schema, value: unknown): Control {
  const given = value ?? null, fallback = schema.default;
  const words = choices(schema);
  if (schema.type === "boolean" || words) {
    const options = words ?? [true, false];
    const said = (option: unknown) => (option === true ? tx("yes") : option === false ? tx("no") : String(option));
    const first = fallback === undefined ? "" : tx("defaultIs", { value: said(fallback) });
    const element = el("select", {}, el("option", { value: "" }, first), ...options.map((o) =>
      el("option", { value: JSON.stringify(o), ...(o === given ? { selected: true } : {}) }, said(o))));
    return { element, hint: "", read: () => ({ value: element.value ? (JSON.parse(element.value) as unknown) : null }) };
  }
  const placeholder = fallback === undefined || fallback === null ? "" : String(typeof fallback === "object" ? JSON.stringify(fallback) : fallback);
  if (schema.type === "number" || schema.type === "integer") {
    const element = el("input", { type: "text", inputmode: "decimal", autocomplete: "off", placeholder, value: given === null ? "" : String(given) });
    const read = (): Typed => {
      const text = element.value.trim().replace(",", ".");
      if (!text) return { value: null };
      const number = Number(text);
      return Number.isFinite(number) ? { value: number } : { error: tx("noNumber") };
    };
    return { element, hint: placeholder ? tx("defaultIs", { value: placeholder }) : "", read };
  }
  if (schema.type === "string") {
    const element = el("input", { type: "text", autocomplete: "off", placeholder, value: given === null ? "" : String(given) });
    return { element, hint: "", read: () => ({ value: element.value.trim() || null }) };
  }
  if (schema.type === "array" && schema.items?.type === "string") {
    const lines = Array.isArray(given) ? given.map(String) : [];
    const element = el("textarea", { rows: Math.max(1, Math.min(6, lines.length)) }, lines.join("\n"));
    const read = (): Typed => {
      const all = element.value.split("\n").map((l) => l.trim()).filter((l) => l);
      return { value: all.length > 0 ? all : null };
    };
    return { element, hint: `(${tx("onePerLine")})`, read };
  }
  const element = el("textarea", { rows: 1, placeholder, spellcheck: "false" }, given === null ? "" : JSON.stringify(given));
  const read = (): Typed => {
    if (!element.value.trim()) return { value: null };
    try {
      return { value: JSON.parse(element.value) as unknown };
    } catch {
      return { error: tx("noJson") };
    }
  };
  return { element, hint: `(${tx("asJson")})`, read };
}

/** The words that a value may be; `null` where it may be anything. */
function choices(schema: Schema): readonly unknown[] | null {
  if (schema.enum) return schema.enum;
  if (schema.oneOf?.every((choice) => choice.const !== undefined)) return schema.oneOf.map((choice) => choice.const);
  return null;
}

function ordered(properties: Readonly<Record<string, Schema>>): [string, Schema][] {
  const place = ([key]: [string, Schema]) => (FIRST.includes(key) ? FIRST.indexOf(key) : FIRST.length);
  return Object.entries(properties).sort((p, q) => place(p) - place(q));
}

function isTables(schema: Schema): boolean {
  return schema.type === "array" && schema.items?.properties !== undefined;
}

function about(schema: Schema): string {
  return schema.description ? ` ${schema.description.replaceAll("`", "")}` : "";
}

function singular(name: string): string {
  return name.replace(/s$/, "");
}

function at(value: unknown, key: string): unknown {
  return typeof value === "object" && value !== null ? (value as Readonly<Record<string, unknown>>)[key] : undefined;
}
