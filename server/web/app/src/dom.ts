// Elements in one expression.

export type Child = Node | string | null | undefined | false;
type Attributes = Record<string, string | number | boolean | null | undefined | EventListener>;

function fill(element: Element, attributes: Attributes, children: Child[]): void {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) {
      element.setAttribute(name, String(value));
    }
  }
  for (const child of children) if (child) element.append(child);
}

// el("button", {click: go}, "Go"): functions are listeners, all else attributes.
export function el<K extends keyof HTMLElementTagNameMap>(
    tag: K, attributes: Attributes = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  fill(element, attributes, children);
  return element;
}

export function svg(tag: string, attributes: Attributes = {}, ...children: Child[]): SVGElement {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  fill(element, attributes, children);
  return element;
}

let hints = 0;

// A control under its label; the hint is its description.
export function labelled(text: string, control: HTMLElement, hint = ""): HTMLElement {
  const label = el("label", {class: "field"}, el("span", {}, text), control);
  if (!hint) return label;
  const id = `hint${++hints}`;
  control.setAttribute("aria-describedby", id);
  return el("div", {class: "field"}, label, el("small", {id}, hint));
}

export function select(options: [value: string, text: string][], chosen: string,
                       attributes: Attributes = {}): HTMLSelectElement {
  const element = el("select", attributes,
                     ...options.map(([value, text]) => el("option", {value}, text)));
  element.value = chosen;
  return element;
}

// Leaves a text that is there already as it is: it may be selected, or read aloud.
export function setText(place: HTMLElement, text: string): void {
  if (place.textContent !== text) place.textContent = text;
}

// Says something that happened, to screen readers, too.
export function notice(text: string): void { setText(document.getElementById("notice")!, text); }

// The notices of one part: with "" it takes back what it said itself.
export function voice(): (text: string) => void {
  let said = "";
  return (text) => {
    if (text || document.getElementById("notice")!.textContent === said) notice(text);
    said = text;
  };
}
