// Elements without markup: every text becomes a text node, so that nothing from an input can be read as HTML.

import { fromBase64 } from "./blocks.ts";

type Child = Node | string | null;

/** An HTML element with properties, attributes that are no properties, and children. */
export function el<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Readonly<Record<string, string | number | boolean>> = {},
  ...children: readonly Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  setAll(element, attributes);
  append(element, children);
  return element;
}

/** An SVG element. */
export function svg<K extends keyof SVGElementTagNameMap>(
  tag: K,
  attributes: Readonly<Record<string, string | number | boolean>> = {},
  ...children: readonly Child[]
): SVGElementTagNameMap[K] {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  setAll(element, attributes);
  append(element, children);
  return element;
}

/** A button. Its name is its text, so that what is seen can be said; a sign that is no word gets the hint as its name. */
export function button(text: string, hint: string, press: () => void): HTMLButtonElement {
  const isWord = /\p{L}/u.test(text);
  const element = el("button", { type: "button", ...(hint ? { title: hint } : {}), ...(isWord ? {} : { "aria-label": hint }) }, text);
  element.addEventListener("click", press);
  return element;
}

/** The JPEG that an element of the page carries as base64, decoded. Its text is not used again: its memory is freed. */
export async function embedded(id: string): Promise<HTMLImageElement> {
  const element = document.getElementById(id);
  const url = URL.createObjectURL(new Blob([fromBase64(element?.textContent ?? "")], { type: "image/jpeg" }));
  element?.remove();
  const picture = new Image();
  picture.src = url;
  await picture.decode();
  URL.revokeObjectURL(url);
  return picture;
}

/** A value of the style sheet that follows light and dark. */
export function css(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

function setAll(element: Element, attributes: Readonly<Record<string, string | number | boolean>>): void {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === false) continue;
    element.setAttribute(name, value === true ? "" : String(value));
  }
}

function append(element: Element, children: readonly Child[]): void {
  for (const child of children) if (child !== null) element.append(child);
}
