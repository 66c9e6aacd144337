// A curve over the iterations, as SVG.

import {svg} from "./dom.js";

export interface Point { x: number; y: number }

const kWidth = 480, kHeight = 180, kLeft = 52, kRight = 18, kTop = 12, kBottom = 26;
const kLeastRange = 0.01;  // of the values' axis, as a share of the highest: else ticks look alike

// About so many round numbers between two.
function ticks(low: number, high: number, count: number): number[] {
  const raw = (high - low) / count || 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw) ?? raw;
  const found: number[] = [];
  for (let v = Math.ceil(low / step) * step; v <= high + step * 1e-9; v += step) found.push(v);
  return found;
}

// At most so many of the points, the last one included.
function thin(points: Point[], most: number): Point[] {
  const step = Math.ceil(points.length / most);
  return points.filter((_, i) => i % step === 0 || i === points.length - 1);
}

const short = (v: number): string =>
    Math.abs(v) >= 1000 ? `${+(v / 1000).toPrecision(4)}k` : String(+v.toPrecision(4));

// The range of the values' axis. Values above `shown` of all are cut off: of a loss the first few are far
// off, and the curve's end is what is looked at.
function rangeOf(values: number[], shown: number): [low: number, high: number] {
  const sorted = [...values].sort((a, b) => a - b);
  const low = sorted[0]!, high = sorted[Math.ceil(shown * (sorted.length - 1))]!;
  const least = Math.max(1e-6, kLeastRange * Math.abs(high));
  return high - low < least ? [high - least / 2, high + least / 2] : [low, high];
}

// `shown`: the share of the values, the lowest ones, that the chart's height is for.
export function chart(name: string, unit: string, shown = 1): {element: SVGElement; show: (points: Point[]) => void} {
  const element = svg("svg", {class: "chart", viewBox: `0 0 ${kWidth} ${kHeight}`, role: "img",
                              "aria-label": `${name}: no value yet`});
  const show = (all: Point[]): void => {
    const points = thin(all, 500);
    element.replaceChildren(svg("text", {x: kLeft, y: kTop, class: "name"}, unit ? `${name}, ${unit}` : name));
    if (points.length === 0) return;
    const xs = points.map((p) => p.x), ys = points.map((p) => p.y);
    const [low, high] = rangeOf(ys, shown);
    const x0 = Math.min(...xs), x1 = Math.max(...xs, x0 + 1);
    const px = (x: number): number => kLeft + (x - x0) / (x1 - x0) * (kWidth - kLeft - kRight);
    const py = (y: number): number =>
        kHeight - kBottom - (Math.min(y, high) - low) / (high - low) * (kHeight - kTop - kBottom - 8);
    for (const y of ticks(low, high, 3)) {
      element.append(svg("line", {x1: kLeft, x2: kWidth - kRight, y1: py(y), y2: py(y), class: "grid"}),
                     svg("text", {x: kLeft - 6, y: py(y) + 4, class: "tick end"}, short(y)));
    }
    for (const x of ticks(x0, x1, 4)) {
      element.append(svg("text", {x: px(x), y: kHeight - 8, class: "tick mid"}, short(x)));
    }
    element.append(svg("polyline", {
      points: points.map((p) => `${px(p.x).toFixed(1)},${py(p.y).toFixed(1)}`).join(" "), class: "curve",
    }));
    const last = all[all.length - 1]!;
    element.setAttribute("aria-label", `${name} at iteration ${last.x}: ${short(last.y)} ${unit}`.trim());
  };
  show([]);
  return {element, show};
}
