"""Hoetzlein 2025 (projective displacement mapping): Table 1 and Figure 7, on stand-ins for the models."""

import chart
from common import SPEED, Result, find, number, times, value

# Table 1, GeForce RTX 4090, ms: triangles, primary RMIP, primary PDM, beauty Micro-Mesh, RMIP, PDM.
PAPER = {
    "asteroid": ("Asteroid", 480, 16.4, 16.3, 48.3, 145.6, 60.8),
    "draped-mail": ("Chainmail", 1423, 29.4, 12.6, 28.9, 289.0, 20.7),
    "leather-sphere": ("Leather Sphere", 3968, 21.9, 16.8, 33.7, 230.6, 31.9),
    "orb": ("Orb", 3968, 32.5, 18.2, 68.2, 329.1, 56.8),
    "tree-stump": ("Tree Stump", 7710, 18.9, 13.3, 19.5, 166.2, 18.1),
    "bamboo-dragon": ("Bamboo Dragon", 22308, 14.2, 16.6, 37.7, 282.9, 35.7),
}
PDM, TRIANGLES = "pdm", "tessellation:budget=4"


def table_1(session):
    result = Result(session, "pdm-table-1", "PDM, Table 1: against RMIP and tessellation")
    table, names, ours, theirs = [], [], [], []
    for scene, paper in PAPER.items():
        path = result.scene(scene)
        rows = result.bench(path, ["rmip", PDM, TRIANGLES], rays="primary", label=scene) if path else []
        if not rows:
            continue
        primary = {m: value(find(rows, m, "primary"), "mrays_median") for m in ("rmip", PDM)}
        frames = {m: value(find(rows, m, "frame"), "frame_ms_median") for m in ("rmip", PDM, TRIANGLES)}
        pdm = find(rows, PDM, "primary")
        table.append([scene, number(primary["rmip"]), number(primary[PDM]), times(primary[PDM] / primary["rmip"]),
                      number(frames[TRIANGLES]), number(frames["rmip"]), number(frames[PDM]),
                      times(frames["rmip"] / frames[PDM]), number(value(pdm, "missed")), number(value(pdm, "dt_p99")),
                      times(paper[2] / paper[3]), times(paper[5] / paper[6])])
        names.append(scene)
        ours.append(frames["rmip"] / frames[PDM])
        theirs.append(paper[5] / paper[6])
    result.text("Primary rays in Mrays/s and path-traced frames in ms, all threads; *ratio* is how much faster `pdm` is "
                "than `rmip`. Samples are one texel apart. `pdm` is an approximation: *missed* counts primary rays of "
                "the %d that it lets through, and the 99th percentile of |dt| is in diagonals of the scene, both against "
                "the exact unnormalised surface. Triangles stand where the paper has Micro-Meshes, at most 4 million." %
                session.limits["count"])
    result.table(["scene", "primary: rmip", "pdm", "ratio", "frame: triangles", "rmip", "pdm", "ratio", "missed",
                  "dt p99", "theirs: primary", "beauty"], table)
    if names:
        result.figure("pdm-table-1", chart.bars("Frame time, speed-up of pdm over rmip", "speed-up", names,
                                                ["ours (CPU)", "paper (GPU)"], [ours, theirs], log_y=True),
                      "Speed-up of pdm over rmip, per scene")
    result.save()


def figure_7(session):
    result = Result(session, "pdm-figure-7", "PDM, Figure 7: error and time against sample spacing")
    steps = {3: [8, 1, 0.25], 5: [8, 4, 2, 1, 0.5, 0.25]}.get(session.limits["points"], [16, 8, 4, 2, 1, .5, .25, .125])
    path = result.scene("orb")
    if path:
        methods = ["pdm:step=%g" % s for s in steps] + ["pdm:step=%g:jitter=on" % steps[0], "rmip"]
        rows = result.bench(path, methods, rays="primary,grazing", frame=False, label="orb")
        result.text("`orb`; spacing in texels of the base triangle (the paper's dt is in units of the model). "
                    "|dt| against the exact unnormalised surface, in diagonals of the scene; %d rays of each kind, one "
                    "thread (processor time)." %
                    session.limits["count"])
        for rays in ("primary", "grazing"):
            table = []
            for method in methods:
                row = find(rows, method, rays, 1)
                table.append([method, *(number(value(row, key)) for key in (
                    SPEED, "steps_mean", "missed", "false", "dt_median", "dt_p99"))])
            result.text("### %s rays" % rays.capitalize())
            result.table(["method", "Mrays/s", "steps", "missed", "false", "dt median", "dt p99"], table)
        series = []
        for rays in ("primary", "grazing"):
            points = [(s, find(rows, "pdm:step=%g" % s, rays, 1)) for s in steps]
            series += [("%s, dt p99" % rays, [(s, value(r, "dt_p99")) for s, r in points]),
                       ("%s, dt median" % rays, [(s, value(r, "dt_median")) for s, r in points])]
        result.figure("pdm-figure-7-error", chart.lines("orb: error", "spacing, texels", "|dt| / diagonal", series,
                                                        log_x=True, log_y=True), "Error against spacing")
        series = [(rays, [(s, 1 / value(find(rows, "pdm:step=%g" % s, rays, 1), SPEED)) for s in steps])
                  for rays in ("primary", "grazing")]
        series += [("%s, rmip" % rays, [(s, 1 / value(find(rows, "rmip", rays, 1), SPEED)) for s in steps])
                   for rays in ("primary", "grazing")]
        result.figure("pdm-figure-7-time", chart.lines("orb: time", "spacing, texels", "microseconds per ray", series,
                                                       log_x=True, log_y=True), "Time against spacing")
    result.save()


RESULTS = {"pdm-table-1": table_1, "pdm-figure-7": figure_7}
