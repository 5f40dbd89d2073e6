// Tables that are wider than the screen can be scrolled by keyboard; those that fit are no stop of the Tab key.

/** Lets the Tab key reach elements as long as they scroll, each under the name of the heading above it. */
export function reachable(elements: Iterable<HTMLElement>): void {
  const observer = new ResizeObserver((entries) => {
    for (const { target } of entries) adapt(target as HTMLElement);
  });
  const narrow = matchMedia("(max-width: 700px)").matches;
  for (const element of elements) {
    if (element.closest("#explore")) continue;
    // Maps of a wide wall scroll on every phone; they are measured no earlier than they are drawn.
    if (narrow && element.closest(".maps.wide")) reach(element);
    observer.observe(element);
    if (element.firstElementChild) observer.observe(element.firstElementChild);
  }
}

function adapt(target: HTMLElement): void {
  const element = target.closest<HTMLElement>(".scroll");
  if (!element) return;
  if (element.scrollWidth <= element.clientWidth) {
    for (const name of ["tabindex", "role", "aria-label"]) element.removeAttribute(name);
    return;
  }
  reach(element);
}

function reach(element: HTMLElement): void {
  element.tabIndex = 0;
  element.setAttribute("role", "group");
  element.setAttribute("aria-label", headingOf(element));
}

/** Text of the nearest heading before an element. */
function headingOf(element: HTMLElement): string {
  for (let at: Element | null = element; at; at = at.previousElementSibling ?? at.parentElement) {
    if (/^(H[1-4]|SUMMARY|FIGCAPTION)$/.test(at.tagName)) return at.textContent ?? "";
  }
  return document.title;
}
