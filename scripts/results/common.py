"""What all results share: the levels of effort, running knurl, tables and files."""
import datetime
import html
import json
import math
import os
import platform
import shlex
import subprocess
import sys
import time

# Keyword arguments are what a level reduces. map_size: longest side of the maps, None for full size.
LEVELS = {
    "quick": dict(map_size=128, count=2500, rounds=1, frame=(64, 36, 1), heat=20000, memory="300M",
                  timeout=60, points=3),
    "default": dict(map_size=2048, count=30000, rounds=3, frame=(192, 108, 2), heat=115200, memory="2G",
                    timeout=300, points=5),
    "full": dict(map_size=None, count=200000, rounds=5, frame=(640, 360, 4), heat=518400, memory="12G",
                 timeout=3600, points=8),
}


def machine():
    model, mhz = platform.machine(), ""
    try:
        for line in subprocess.run(["lscpu"], capture_output=True, text=True, check=True,
                                   env=dict(os.environ, LC_ALL="C")).stdout.splitlines():
            key, _, value = line.partition(":")
            if key == "Model name":
                model = value.strip()
            if key == "CPU max MHz":
                mhz = ", %.0f MHz" % float(value)
    except (OSError, subprocess.CalledProcessError, ValueError):
        pass
    load = "%.1f" % os.getloadavg()[0]
    return "%s%s, %d cores; load average %s at the start" % (model, mhz, os.cpu_count() or 1, load)


class Session:
    """One run of the script: where things are, and how much work is done."""

    def __init__(self, knurl, level, out, scenes, command):
        self.knurl, self.level, self.out, self.scenes = knurl, level, out, scenes
        self.limits = LEVELS[level]
        self.command = command
        self.machine = machine()
        self.methods = self.list_methods()
        self.reasons = {}  # why a scene is missing
        os.makedirs(os.path.join(out, "data"), exist_ok=True)

    def list_methods(self):
        text = subprocess.run([self.knurl, "methods"], capture_output=True, text=True, check=True).stdout
        return [line[2:].split()[0] for line in text.splitlines() if line[:2] in ("* ", "  ") and line[2:3] != " "]

    def scene(self, name):
        """Path of a demo scene, written at its first use by this program; None (and a printed reason) if
        there is none."""
        folder = os.path.join(self.scenes, str(self.limits["map_size"] or "full"))
        path = os.path.join(folder, name, name + ".gltf")
        if name in self.reasons:
            return None
        if not os.path.exists(path) or os.path.getmtime(path) < os.path.getmtime(self.knurl):
            size = ["--map-size", str(self.limits["map_size"])] if self.limits["map_size"] else []
            done = subprocess.run([self.knurl, "demo", name, folder, "-q", *size], capture_output=True, text=True)
            if done.returncode != 0 or not os.path.exists(path):
                self.reasons[name] = done.stderr.strip().split("\n")[0] or "no such scene"
                print("  skipped scene %s: %s" % (name, self.reasons[name]), flush=True)
                return None
        return path

    def info(self, path):
        done = subprocess.run([self.knurl, "info", path, "--json", "-q"], capture_output=True, text=True)
        return json.loads(done.stdout) if done.returncode == 0 else None


class Result:
    """One table or figure: its runs, and the page that shows them."""

    def __init__(self, session, name, title):
        self.session, self.name, self.title = session, name, title
        self.runs, self.skipped, self.parts = [], [], []
        self.start = time.monotonic()
        print("%s: %s" % (name, title), flush=True)

    def skip(self, text):
        if text not in self.skipped:
            print("  skipped: " + text, flush=True)
            self.skipped.append(text)

    def scene(self, name):
        path = self.session.scene(name)
        if not path:
            self.skip("scene `%s`: %s" % (name, self.session.reasons[name]))
        return path

    def bench(self, path, methods, rays="none", frame=True, count=None, rounds=None, extra=(), label=None):
        """Rows of `knurl bench`; methods that do not exist are left out, failures give no rows."""
        limits, known = self.session.limits, []
        for method in methods:
            if method.split(":")[0] in self.session.methods:
                known.append(method)
            else:
                self.skip("method `%s` is not in this build" % method)
        if not known:
            return []
        arguments = ["bench", path, "--methods", ",".join(known), "--rays", rays, "--json", "-", "-q",
                     "--count", str(count or limits["count"]), "--rounds", str(rounds or limits["rounds"]),
                     "--memory-limit", limits["memory"], *map(str, extra)]
        if frame:
            arguments += ["--frame", "x".join(map(str, limits["frame"]))]
        try:
            done = subprocess.run([self.session.knurl, *arguments], stdout=subprocess.PIPE,
                                  stderr=subprocess.PIPE, text=True, timeout=limits["timeout"])
        except subprocess.TimeoutExpired:
            self.skip("`%s`: took over %d s" % (label or os.path.basename(path), limits["timeout"]))
            return []
        if done.returncode != 0:
            reason = (done.stderr.strip().split("\n") or ["?"])[-1]
            self.skip("`%s`: %s" % (label or os.path.basename(path), reason))
            return []
        data = json.loads(done.stdout)
        for row in data["results"]:
            if row["error"]:
                self.skip("%s on %s: %s" % (row["method"], row["scene"].split("/")[-1], row["error"]))
        data["command"] = "knurl " + " ".join(shlex.quote(a) for a in arguments)
        data["label"] = label
        self.runs.append(data)
        return data["results"]

    def text(self, *paragraphs):
        self.parts += paragraphs

    def table(self, head, rows, left=1):
        """A Markdown table; the first `left` columns are text."""
        lines = ["| " + " | ".join(head) + " |",
                 "|" + "|".join([" --- "] * left + [" ---: "] * (len(head) - left)) + "|"]
        lines += ["| " + " | ".join(row) + " |" for row in rows]
        self.parts.append("\n".join(lines))

    def figure(self, name, svg, caption):
        with open(os.path.join(self.session.out, name + ".svg"), "w") as file:
            file.write(svg)
        self.parts.append("![%s](%s.svg)" % (html.escape(caption), name))

    def save(self):
        session = self.session
        out = session.out
        limits = dict(session.limits)
        with open(os.path.join(out, "data", self.name + ".json"), "w") as file:
            json.dump(dict(name=self.name, title=self.title, level=session.level, limits=limits,
                           machine=session.machine, date=today(), runs=self.runs, skipped=self.skipped), file,
                      indent=1)
            file.write("\n")
        discussion = os.path.join(out, "discussion", self.name + ".md")
        lines = ["# " + self.title, ""]
        lines += ["%s. `%s`; %s." % (session.machine, session.command, today()),
                  reductions(session.level), ""]
        for part in self.parts:
            lines += [part, ""]
        if self.skipped:
            lines += ["Not measured:", ""] + ["- " + text for text in self.skipped] + [""]
        lines += ["## Discussion", ""]
        if os.path.exists(discussion):
            with open(discussion) as file:
                lines += [file.read().strip(), ""]
        else:
            lines += ["<!-- Kept by hand in discussion/%s.md; none yet. -->" % self.name, ""]
        lines += ["Data: [data/%s.json](data/%s.json), which holds every command line." % (self.name, self.name)]
        with open(os.path.join(out, self.name + ".md"), "w") as file:
            file.write("\n".join(lines) + "\n")
        print("  %.0f s" % (time.monotonic() - self.start), flush=True)


def today():
    return datetime.date.today().isoformat()


def reductions(level):
    limits = LEVELS[level]
    width, height, samples = limits["frame"]
    maps = "maps at full size" if not limits["map_size"] else "maps of at most %d texels a side" % limits["map_size"]
    return ("Level *%s*: %s, frames of %d x %d pixels at %d spp, %d rays a set, %d rounds, at most %s of memory "
            "for a method." % (level, maps, width, height, samples, limits["count"], limits["rounds"],
                               limits["memory"]))


# ---- picking and printing numbers ----

def find(rows, method, rays, threads=None):
    """The row of a method and ray set (threads None: the most threads), or None if nothing was measured."""
    found = [r for r in rows if r["method"] == method and r["rays"] == rays and not r["error"] and
             (threads is None or r["threads"] == threads)]
    return max(found, key=lambda r: r["threads"]) if found else None


SPEED = "mrays_cpu_median"  # for one thread: rays per second of processor time, as the machine may be busy


def value(row, key):
    return row[key] if row and row[key] is not None else math.nan


def number(x, digits=3):
    if x is None or math.isnan(x):
        return "-"
    if isinstance(x, int):
        return str(x)
    if x == 0:
        return "0"
    if not 1e-3 <= abs(x) < 1e6:
        return "%.1e" % x
    return "%.*f" % (max(0, digits - 1 - math.floor(math.log10(abs(x)))), x)


def times(x):
    return "-" if math.isnan(x) else "x" + number(x)


def size(count):
    if count is None or math.isnan(count):
        return "-"
    for unit in ("B", "KiB", "MiB", "GiB"):
        if count < 1024 or unit == "GiB":
            return "%.*f %s" % (0 if unit == "B" or count >= 100 else 1, count, unit)
        count /= 1024


def structure_bytes(row):
    """What a method adds to mesh and map: its shells, and the range bounds that it reads."""
    if not row or not row["bytes"]:
        return math.nan
    parts, method = row["bytes"], row["method"]
    if method.startswith("tessellation"):
        return parts["shells"] + parts["bvh"]
    used = parts["shells"]
    if method.startswith("tfdm") or "bounds=minmax" in method:
        used += parts["map_minmax"]
    elif method.startswith("rmip"):
        used += parts["map_rmip"]
    elif method.startswith("fast"):
        used += parts.get("map_blocks", 0)
    return used


def mean(values):
    known = [v for v in values if not math.isnan(v)]
    return sum(known) / len(known) if known else math.nan


def geometric_mean(values):
    known = [math.log(v) for v in values if v > 0]
    return math.exp(sum(known) / len(known)) if known else math.nan


def fail(text):
    print(text, file=sys.stderr)
    sys.exit(2)
