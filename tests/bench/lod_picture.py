#!/usr/bin/env python3
"""Draws the JSON of lod_bench: levels and their twins as two curves, error against bytes and rates.

Usage: lod_picture.py lod.json -o lod.svg [--error p99] [--panels disk_bytes,memory_bytes,primary_mrays,diffuse_mrays]
One row a scan, one panel a figure. Standard library alone.
"""
import argparse
import json
import math
from xml.sax.saxutils import escape

PANELS = {  # figure: title, factor, whether a log axis
    "disk_bytes": ("on disk [MB]", 1e-6, True),
    "disk_bytes_zstd": ("on disk, twins by zstd [MB]", 1e-6, True),
    "disk_bytes_best": ("on disk, twins at their best [MB]", 1e-6, True),
    "memory_bytes": ("in memory [MB]", 1e-6, True),
    "primary_mrays": ("primary [Mrays/s]", 1, False),
    "diffuse_mrays": ("diffuse [Mrays/s]", 1, False),
    "build_s": ("build [s]", 1, False),
}
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 250, 210, 46, 14, 34, 40
LEVELS, TWINS, INK, GRID = "#1668b8", "#d9730d", "#444", "#ddd"


def log_ticks(low, high):
    return [10.0**e for e in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)]


def linear_ticks(high):
    step = 10.0 ** math.floor(math.log10(high))
    step = next(s for s in (step / 5, step / 2, step, 2 * step) if high / s <= 6)
    return [i * step for i in range(math.ceil(high / step) + 1)]


def label(value):
    if value and (value >= 1e4 or value < 1e-2):
        return f"1e{round(math.log10(value))}"
    return f"{value:g}"


def panel(x0, y0, title, points, is_log, error):
    """`points`: for each of levels and twins, (error, figure, name) each."""
    flat = [p for curve in points for p in curve]
    xs = log_ticks(min(p[0] for p in flat), max(p[0] for p in flat))
    ys = log_ticks(min(p[1] for p in flat), max(p[1] for p in flat)) if is_log else linear_ticks(max(p[1] for p in flat))
    right, bottom = x0 + WIDTH - RIGHT, y0 + HEIGHT - BOTTOM

    def at(value, ticks, low, high, log):
        f = math.log10 if log else float
        return low + (f(value) - f(ticks[0])) / ((f(ticks[-1]) - f(ticks[0])) or 1) * (high - low)

    def place(p):
        return at(p[0], xs, x0 + LEFT, right, True), at(p[1], ys, bottom, y0 + TOP, is_log)

    out = [f'<text x="{x0 + LEFT}" y="{y0 + TOP - 10}" font-weight="bold">{escape(title)}</text>']
    for tick in xs:
        x = at(tick, xs, x0 + LEFT, right, True)
        out.append(f'<path d="M{x:.1f} {y0 + TOP}V{bottom}" stroke="{GRID}"/>')
        out.append(f'<text x="{x:.1f}" y="{bottom + 14}" text-anchor="middle">{label(tick)}</text>')
    for tick in ys:
        y = at(tick, ys, bottom, y0 + TOP, is_log)
        out.append(f'<path d="M{x0 + LEFT} {y:.1f}H{right}" stroke="{GRID}"/>')
        out.append(f'<text x="{x0 + LEFT - 5}" y="{y + 4:.1f}" text-anchor="end">{label(tick)}</text>')
    out.append(f'<text x="{(x0 + LEFT + right) / 2}" y="{bottom + 29}" text-anchor="middle">'
               f"{error} depth error / diagonal</text>")
    for curve, colour in zip(points, (LEVELS, TWINS)):
        if not curve:
            continue
        line = "L".join("{:.1f} {:.1f}".format(*place(p)) for p in curve)
        out.append(f'<path d="M{line}" fill="none" stroke="{colour}" stroke-width="2"/>')
        for p in curve:
            x, y = place(p)
            out.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}"/>')
            if colour == LEVELS:
                out.append(f'<text x="{x:.1f}" y="{y - 7:.1f}" text-anchor="middle" fill="{colour}">{escape(p[2])}</text>')
    return out


def curve_of(results, figure, factor, error):
    """Of levels or twins; without what was not measured."""
    if figure.startswith("disk_bytes"):  # of a level there is only one
        results = [(r, r.get(figure, r["disk_bytes"]), name) for r, name in results]
    else:
        results = [(r, r.get(figure), name) for r, name in results]
    return [(r["error"][error], value * factor, name) for r, value, name in results if value and r["error"][error]]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("json")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--error", default="median", help="which error: median, p99, ...")
    parser.add_argument("--panels", default="disk_bytes,memory_bytes,primary_mrays,diffuse_mrays")
    arguments = parser.parse_args()
    with open(arguments.json, encoding="utf-8") as file:
        results = json.load(file)
    scans = list(dict.fromkeys(r["scan"] for r in results))
    names = [name for name in arguments.panels.split(",") if name]
    out = []
    for row, scan in enumerate(scans):
        of_scan = [r for r in results if r["scan"] == scan]
        levels = [(r, r["level"]) for r in of_scan]
        twins = [(r["twin"], r["level"]) for r in of_scan if r["twin"]]
        y0 = row * (HEIGHT + 24) + 24
        out.append(f'<text x="{LEFT}" y="{y0 + 2}" font-size="14" font-weight="bold">{escape(scan)}</text>')
        for column, name in enumerate(names):
            title, factor, is_log = PANELS[name]
            points = [curve_of(of, name, factor, arguments.error) for of in (levels, twins)]
            if any(points):
                out += panel(column * WIDTH, y0, title, points, is_log, arguments.error)
    width, height = WIDTH * len(names), len(scans) * (HEIGHT + 24) + 24
    for x, colour, text in ((width - 330, LEVELS, "levels"), (width - 250, TWINS, "twins: decimated meshes, Embree")):
        out.append(f'<circle cx="{x}" cy="14" r="4" fill="{colour}"/><text x="{x + 9}" y="18">{text}</text>')
    with open(arguments.output, "w", encoding="utf-8") as file:
        file.write(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
                   f'height="{height}" font-family="sans-serif" font-size="11" fill="{INK}">\n'
                   f'<rect width="100%" height="100%" fill="#fff"/>\n' + "\n".join(out) + "\n</svg>\n")


if __name__ == "__main__":
    main()
