// Two pictures over each other, with a slider between them.

import {el} from "./dom.js";

export function compare(before: string, after: string): {
  element: HTMLElement; show: (beforeUrl: string, afterUrl: string) => void;
} {
  const under = el("img", {alt: after});
  const over = el("img", {alt: before, class: "over"});
  const line = el("div", {class: "divider"});
  const slider = el("input", {type: "range", min: 0, max: 100, value: 50,
                              "aria-label": `${before} on the left, ${after} on the right`});
  const place = (): void => {
    over.style.clipPath = `inset(0 ${100 - Number(slider.value)}% 0 0)`;
    line.style.left = `${slider.value}%`;
  };
  slider.addEventListener("input", place);
  place();
  const frame = el("div", {class: "frame"}, under, over, line);
  const drag = (event: PointerEvent): void => {
    if (event.buttons === 0) return;
    const box = frame.getBoundingClientRect();
    slider.value = String(Math.round((event.clientX - box.left) / box.width * 100));
    place();
  };
  frame.addEventListener("pointerdown", drag);
  frame.addEventListener("pointermove", drag);
  const element = el("figure", {class: "compare", hidden: true}, frame, slider,
                     el("figcaption", {}, el("span", {}, before), el("span", {}, after)));
  return {
    element,
    show(beforeUrl, afterUrl) {
      over.src = beforeUrl;
      under.src = afterUrl;
      element.hidden = false;
    },
  };
}
