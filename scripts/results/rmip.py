"""Thonat et al. 2023 (RMIP): Table 1, Figures 9 to 12, on stand-ins for their scenes."""
import math
import os

import chart
from common import SPEED, Result, find, geometric_mean, mean, number, size, structure_bytes, times, value

# Table 1: name, triangles, map, tiling, TFDM memory and GPU time, then memory and speed-up of uniform
# pre-tessellation and of RMIP at low, normal and high resolution.
PAPER = {
    "alien-sphere": ("Alien Sphere", "0.9k", "2k", "6 x 8", "21 MB", "56 ms", 186, 91, .048, 2.7, 1.3, 3.4, 30, 2.7),
    "wicker-basket": ("Basket", "4.8k", "2k", "5 x 5", "21 MB", "117 ms", 235, 67, .048, 5.0, 1.3, 6.3, 30, 5.0),
    "creature": ("Creature", "53k", "4k", "1 x 1", "85 MB", "115 ms", 40, 232, .012, 4.3, 1.6, 7.8, 7.6, 9.3),
    "diving-helmet": ("Diving Helmet", "2.5k", "4k", "1 x 1", "85 MB", "33 ms", 30, 95, .012, 2.5, 1.6, 3.0, 7.6, 3.5),
    "medieval-helmet": ("Medieval Helmet", "2.3k", "2k", "5 x 5", "21 MB", "42 ms", 111, 93, .048, 2.5, 1.3, 3.2, 30, 2.8),
    "elven-armor": ("Elven Armor", "0.8k", "4k", "2 x 2", "85 MB", "53 ms", 37, 132, .012, 2.7, 1.6, 3.4, 7.6, 4.1),
    "ninja-head": ("Ninja Head", "8.7k", "2k", "5 x 5", "21 MB", "182 ms", 103, 340, .048, 6.1, 1.3, 9.2, 30, 7.7),
    "terracotta-roof": ("Terracotta Roof", "128", "2k", "2 x 2", "21 MB", "27 ms", 97, 69, .048, 2.2, 1.3, 3.0, 30, 2.4),
    "desert-tire": ("Desert Tire", "9k", "4k x 3", "25^2, 6 x 1", "256 MB", "606 ms", 10, 1151, .012, 6.5, .32, 11, 7.6, 9.6),
    "rough-glass": ("Glass", "2.2k", "2k", "1 x 1", "42 MB", "41 ms", 51, 12, .66, 2.5, 1.3, 2.7, 16, 2.7),
}
OFF = "rmip:inversion=off"
CELLS = {"low": 32, "normal": 8, "high": 2}  # texels per side of a cell of the table: r = N / 32, N / 8, N / 2


def speedup(rows, method, base, rays="frame"):
    """How much faster `method` is than `base`."""
    a, b = find(rows, method, rays), find(rows, base, rays)
    key = "frame_ms_median" if rays == "frame" else "mrays_median"
    ratio = value(b, key) / value(a, key) if a and b else math.nan
    return ratio if rays == "frame" or math.isnan(ratio) else 1 / ratio


def ratio(rows, a, b, key, rays):
    x, y = value(find(rows, a, rays), key), value(find(rows, b, rays), key)
    return x / y if y else math.nan


STRONG = "tfdm:leaf-texels=8:boxes=normal"


def memory_ratio(rows, method):
    a, b = structure_bytes(find(rows, method, "frame")), structure_bytes(find(rows, "tfdm", "frame"))
    return a / b if b else math.nan


def measure(result, scene, path):
    """Runs of Table 1 and Figure 12: one per resolution of the table."""
    runs = {}
    for name, cell in CELLS.items():
        normal = name == "normal"
        methods = ["tfdm", "rmip", OFF] + ([STRONG, "tessellation"] if normal else [])
        runs[name] = result.bench(path, methods, rays="primary,diffuse" if normal else "none", label=scene,
                                  extra=["--rmip-cell", cell])
    return runs


def table_1(session):
    result = Result(session, "rmip-table-1", "RMIP, Table 1: speed and memory against TFDM")
    scenes, all_runs = [], {}
    for scene in PAPER:
        path = result.scene(scene)
        if not path:
            continue
        all_runs[scene] = measure(result, scene, path)
        if all_runs[scene]["normal"]:
            scenes.append((scene, path))
    result.text("Speed-ups of a path-traced frame over `tfdm` (x1), and memory of the structures (range bounds and "
                "data of the shells; for pre-tessellation vertices and hierarchy) relative to that of `tfdm`. "
                "*Theirs* is the paper's GPU column; its low, normal and high resolutions are cells of 32 (64 for "
                "4k maps), 8 and 2 (4) texels; ours are 32, 8 and 2 throughout. Our table is the compressed one of "
                "their section 5. `tfdm` is the paper's: a tree down to single texels, boxes along the world's axes; "
                "*strong tfdm* is `%s`, which borrows marching from RMIP." % STRONG)
    head = ["scene", "ours: tfdm", "frame", "strong tfdm", "low mem.", "low", "RMIP mem.", "RMIP", "high mem.", "high",
            "tess. mem.", "tess.", "theirs: low", "RMIP", "high", "tess."]
    table = []
    for scene, path in scenes:
        runs, paper = all_runs[scene], PAPER[scene]
        normal = runs["normal"]
        row = [scene, size(structure_bytes(find(normal, "tfdm", "frame"))),
               number(value(find(normal, "tfdm", "frame"), "frame_ms_median")) + " ms",
               times(speedup(normal, STRONG, "tfdm"))]
        for name in CELLS:
            row += [times(memory_ratio(runs[name], "rmip")), times(speedup(runs[name], "rmip", "tfdm"))]
        tessellated = memory_ratio(normal, "tessellation")
        if math.isnan(tessellated):
            info = session.info(path)
            base = structure_bytes(find(normal, "tfdm", "frame"))
            row += ["(x%.0f)" % (info["tessellated_bytes"] / base) if info and base else "-", "-"]
        else:
            row += [times(tessellated), times(speedup(normal, "tessellation", "tfdm"))]
        row += [times(paper[9]), times(paper[11]), times(paper[13]), times(paper[7])]
        table.append(row)
    result.table(head, table)
    result.text("Tessellation has one vertex per texel; in brackets an estimate, where it was not built. The paper's "
                "memory columns: low x0.012 to x0.66, RMIP x0.32 to x1.6, high x7.6 to x30, pre-tessellation x10 to "
                "x235 of a minmax mipmap that goes down to single texels.")
    result.table(["scene", "primary: tfdm", "rmip", "ratio", "diffuse: tfdm", "rmip", "ratio", "steps: tfdm", "rmip", "ratio",
                  "build: tfdm", "rmip"], [rays_row(scene, all_runs[scene]["normal"]) for scene, _ in scenes])
    result.text("Mrays/s on one thread (of processor time); traversal steps of primary rays, bounds and texels visited; build in ms.")
    if scenes:
        names = [s for s, _ in scenes]
        ours = [[speedup(all_runs[s][c], "rmip", "tfdm") for s in names] for c in CELLS]
        result.text("Mean speed-up of a frame: low %s, normal %s, high %s (theirs, on a GPU: x3.8, x5.2, x5.4)." %
                    tuple(times(mean(row)) for row in ours))
        strong = [speedup(all_runs[s]["normal"], STRONG, "tfdm") for s in names]
        result.text("Geometric means: low %s, normal %s, high %s, strong tfdm %s." %
                    tuple(times(geometric_mean(row)) for row in [*ours, strong]))
        result.figure("rmip-table-1", chart.bars("Frame time, speed-up over tfdm", "speed-up", names,
                                                 ["cells of 32", "cells of 8", "cells of 2", "paper (GPU), RMIP"],
                                                 ours + [[PAPER[s][11] for s in names]]),
                      "Speed-up of a frame over tfdm, per scene")
    result.save()
    figure_12(session, scenes, all_runs, result.runs)


def rays_row(scene, rows):
    row = [scene]
    for rays in ("primary", "diffuse"):
        a, b = (value(find(rows, m, rays, 1), SPEED) for m in ("tfdm", "rmip"))
        row += [number(a), number(b), times(b / a)]
    a, b = (value(find(rows, m, "primary", 1), "steps_mean") for m in ("tfdm", "rmip"))
    row += [number(a), number(b), times(a / b if b else math.nan)]
    return row + [number(value(find(rows, m, "primary", 1), "build_ms")) for m in ("tfdm", "rmip")]


def figure_12(session, scenes, all_runs, runs):
    result = Result(session, "rmip-figure-12", "RMIP, Figure 12: benefit of inversion during traversal")
    result.runs = runs
    result.text("Frame time with inversion relative to without, lower is better; below 1 it pays. The paper has, on "
                "CPUs, values mostly below 1. The runs are those of Table 1.")
    names = [s for s, _ in scenes]
    values = [[1 / speedup(all_runs[s][c], "rmip", OFF) for s in names] for c in CELLS]
    result.table(["scene", "cells of 32", "cells of 8", "cells of 2", "steps of primary rays, on / off"],
                 [[s, *(number(row[i]) for row in values), number(ratio(all_runs[s]["normal"], "rmip", OFF, "steps_mean",
                                                                      "primary"))] for i, s in enumerate(names)])
    if names:
        result.figure("rmip-figure-12", chart.bars("Frame time, inversion on / off", "relative time", names,
                                                   ["cells of 32", "cells of 8", "cells of 2"], values),
                      "Relative frame time of inversion")
    result.save()


def figure_9(session):
    result = Result(session, "rmip-figure-9", "RMIP, Figure 9: traversal steps of primary rays")
    result.text("Two displaced triangles; steps per pixel, one logarithmic scale for both: black is 1 step, then blue, "
                "red, orange, yellow, and white the most. Texels visited by marching count as steps.")
    for scene in ("plane", "relief-spikes"):
        path = result.scene(scene)
        if not path:
            continue
        stem = os.path.join(session.out, "rmip-figure-9.png")
        rows = result.bench(path, ["tfdm", "rmip"], rays="primary", frame=False, count=session.limits["heat"],
                            rounds=1, extra=["--heat-map", stem])
        if not rows:
            continue
        cells = []
        for method in ("tfdm", "rmip"):
            row = find(rows, method, "primary", 1)
            cells.append([method, number(value(row, "steps_mean")), number(value(row, "steps_p99")),
                          number(value(row, "steps_max"))])
        result.text("### `%s`" % scene, "White is %d steps." % result.runs[-1]["heat_maps"][0]["white"])
        for picture in result.runs[-1]["heat_maps"]:
            result.text("`%s`\n\n![steps of %s](%s)" % (picture["method"], picture["method"],
                                                      os.path.basename(picture["file"])))
        result.table(["method", "mean", "99th percentile", "maximum"], cells)
        result.text("Steps, tfdm / rmip: %s (theirs: an order of magnitude)." %
                    times(ratio(rows, "tfdm", "rmip", "steps_mean", "primary")))
    result.save()


def figure_10(session):
    result = Result(session, "rmip-figure-10", "RMIP, Figure 10: texel-marching scale, resolution and inversion")
    scales = {3: [1, 6, 64], 5: [1, 2, 6, 16, 64]}.get(session.limits["points"], [1, 2, 4, 6, 8, 16, 32, 64])
    setups = [("RMIP, cells of 32", 32, ""), ("RMIP, cells of 8", 8, ""), ("RMIP, cells of 2", 2, ""),
              ("minmax mipmap", 8, ":bounds=minmax"), ("cells of 8, no inversion", 8, ":inversion=off")]
    for scene in ("elven-armor", "ninja-head"):
        path = result.scene(scene)
        if not path:
            continue
        series, base = [], []
        for cell in (32, 8, 2):
            variants = [(name, suffix) for name, c, suffix in setups if c == cell]
            methods = ["rmip:marching-scale=%d%s" % (s, suffix) for _, suffix in variants for s in scales]
            rows = result.bench(path, ["tfdm", *methods], label="%s, cells of %d" % (scene, cell),
                                extra=["--rmip-cell", cell])
            base.append(value(find(rows, "tfdm", "frame"), "frame_ms_median"))
            for name, suffix in variants:
                series.append((name, [(s, 1 / speedup(rows, "rmip:marching-scale=%d%s" % (s, suffix), "tfdm"))
                                      for s in scales]))
        order = [name for name, _, _ in setups]
        series.sort(key=lambda item: order.index(item[0]))
        best = min((y for name, points in series if name == order[1] for _, y in points if math.isfinite(y)),
                   default=math.nan)
        series = [(name, [(x, y / best) for x, y in points]) for name, points in series]
        series.append(("tfdm", [(s, 1 / best) for s in scales]))
        result.text("### `%s`" % scene, "Frame time relative to the best of cells of 8; each run against `tfdm` in the "
                    "same rounds (%s ms)." % ", ".join(number(b) for b in base))
        result.table(["setup", *("scale %d" % s for s in scales)],
                     [[name, *(number(y) for _, y in points)] for name, points in series])
        result.figure("rmip-figure-10-" + scene, chart.lines(scene, "marching scale, texels", "relative frame time",
                                                             series, log_x=True, log_y=True),
                      "Frame time against marching scale, " + scene)
    result.save()


def figure_11(session):
    result = Result(session, "rmip-figure-11", "RMIP, Figure 11: displacement and tiling beyond the original")
    factors = {3: [1, 4], 5: [1, 2, 4]}.get(session.limits["points"], [1, 2, 4, 8])
    scenes = ["alien-sphere", "wicker-basket", "elven-armor", "terracotta-roof"]
    if session.limits["points"] == 3:
        scenes = scenes[:2]
    for option, title in (("--disp-scale", "displacement"), ("--tile-scale", "tiling")):
        series = []
        for scene in scenes:
            path = result.scene(scene)
            if not path:
                continue
            points = []
            for factor in factors:
                rows = result.bench(path, ["tfdm", "rmip"], label="%s, %s x%d" % (scene, title, factor),
                                    extra=[option, factor])
                points.append((factor, speedup(rows, "rmip", "tfdm")))
            series.append((scene, points))
        result.text("### Scaled %s" % title, "Speed-up of a frame, `rmip` over `tfdm`. The paper's rise to both sides.")
        result.table(["scene", *("x%d" % f for f in factors)], [[s, *(number(y) for _, y in p)] for s, p in series])
        if series:
            result.figure("rmip-figure-11-" + title, chart.lines("Scaled " + title, "factor", "speed-up", series, log_x=True),
                          "Speed-up against scaled " + title)
    result.save()


RESULTS = {"rmip-table-1": table_1, "rmip-figure-9": figure_9, "rmip-figure-10": figure_10,
           "rmip-figure-11": figure_11}
