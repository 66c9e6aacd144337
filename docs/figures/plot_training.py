#!/usr/bin/env python3
"""Draws PSNR and SSIM over training time from the JSON of `litags-bench train --evaluate-every`.

    plot_training.py run.json [run2.json ...] > training.svg

Each run is one line, named after its file. Standard library only.
"""

import json
import math
import pathlib
import sys

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 420, 300, 52, 14, 30, 44
COLORS = ["#1f5fa8", "#c0502a", "#2f8f4e", "#7a4fa3"]


def ticks(low, high, count=5):
    """Round numbers that cover [low, high] in at most `count` steps or so."""
    span = max(high - low, 1e-9)
    magnitude = 10.0 ** math.floor(math.log10(span / count))
    step = next(m * magnitude for m in (1, 2, 5, 10) if span <= count * m * magnitude)
    first = math.floor(low / step)
    return [step * i for i in range(first, math.ceil(high / step) + 1)]


def panel(x0, title, key, runs):
    points = [(h["seconds"] / 60, h[key]) for _, history in runs for h in history]
    x_max = max(x for x, _ in points)
    ys = ticks(min(y for _, y in points), max(y for _, y in points))
    xs = ticks(0, x_max)
    y_low, y_high, x_high = ys[0], ys[-1], xs[-1]
    sx = lambda x: x0 + LEFT + (WIDTH - LEFT - RIGHT) * x / x_high
    sy = lambda y: HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (y - y_low) / (y_high - y_low)
    out = [f'<text x="{x0 + LEFT}" y="18" font-weight="bold">{title}</text>']
    for y in ys:
        out.append(f'<path d="M{sx(0):.1f} {sy(y):.1f}H{sx(x_high):.1f}" stroke="#ddd"/>')
        out.append(f'<text x="{sx(0) - 6:.1f}" y="{sy(y) + 4:.1f}" text-anchor="end">{y:.4g}</text>')
    for x in xs:
        out.append(
            f'<text x="{sx(x):.1f}" y="{HEIGHT - BOTTOM + 16}" text-anchor="middle">{x:.3g}</text>')
    out.append(f'<text x="{sx(x_high / 2):.1f}" y="{HEIGHT - 8}" text-anchor="middle">minutes</text>')
    for i, (_, history) in enumerate(runs):
        line = " ".join(f"{sx(h['seconds'] / 60):.1f},{sy(h[key]):.1f}" for h in history)
        out.append(f'<polyline points="{line}" fill="none" stroke="{COLORS[i % 4]}" '
                   'stroke-width="1.8"/>')
    return out


def main():
    runs = [(pathlib.Path(p).stem, json.loads(pathlib.Path(p).read_text())["history"])
            for p in sys.argv[1:]]
    if not runs or not all(history for _, history in runs):
        sys.exit(__doc__)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * WIDTH} {HEIGHT + 20}" '
           'font-family="sans-serif" font-size="12">',
           f'<rect width="{2 * WIDTH}" height="{HEIGHT + 20}" fill="white"/>']
    out += panel(0, "PSNR at the test views, dB", "psnr", runs)
    out += panel(WIDTH, "SSIM at the test views", "ssim", runs)
    for i, (name, _) in enumerate(runs):
        out.append(f'<text x="{LEFT + i * 180}" y="{HEIGHT + 14}" fill="{COLORS[i % 4]}">{name}</text>')
    print("\n".join(out + ["</svg>"]))


if __name__ == "__main__":
    main()
