"""Runs the measurements that papers report and writes docs/results. Called by scripts/results.sh."""
import argparse
import os
import sys
import time

import fast
import pdm
import relief
import rmip
from common import LEVELS, Session, fail, reductions, today

RESULTS = {**rmip.RESULTS, **pdm.RESULTS, **relief.RESULTS, **fast.RESULTS}
PAGES = ["rmip-table-1", "rmip-figure-9", "rmip-figure-10", "rmip-figure-11", "rmip-figure-12", "pdm-table-1",
         "pdm-figure-7", "baboud-table-1", "baboud-figure-12", "kolb-tables", "fast"]


def parse():
    parser = argparse.ArgumentParser(prog="scripts/results.sh", description="Measure what the papers measured.")
    level = parser.add_mutually_exclusive_group()
    level.add_argument("--quick", action="store_true", help="tiny maps and few rays: under 3 minutes, to see that it runs")
    level.add_argument("--full", action="store_true", help="maps, rays and frames of full size: hours")
    parser.add_argument("--only", metavar="A,B", help="some of: " + ", ".join(RESULTS))
    parser.add_argument("--out", help="where pages go (default docs/results, with --quick out/results-quick)")
    parser.add_argument("--scenes", default="out/results-scenes", help="where scenes are written (default %(default)s)")
    parser.add_argument("--knurl", required=True, help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.level = "quick" if options.quick else "full" if options.full else "default"
    options.out = options.out or ("out/results-quick" if options.quick else "docs/results")
    wanted = options.only.split(",") if options.only else list(RESULTS)
    for name in wanted:
        if name not in RESULTS:
            fail("scripts/results.sh: --only: found '%s', expected some of %s" % (name, ", ".join(RESULTS)))
    return options, wanted


def write_index(session):
    lines = ["# Results", "", "What the papers measured, measured with knurl on stand-ins for their scenes "
             "(`knurl demo list`). Written by `scripts/results.sh`; discussions are kept by hand in `discussion/`, "
             "one paragraph in a file named like the page.", "", "| page | |", "| --- | --- |"]
    for name in PAGES:
        path = os.path.join(session.out, name + ".md")
        if os.path.exists(path):
            with open(path) as file:
                lines.append("| [%s](%s.md) | %s |" % (name, name, file.readline().strip("# \n")))
    for name, title in (("curved-bases", "Marching methods on a curved base"),
                        ("release", "Figures of the README, truth and watertightness")):
        if os.path.exists(os.path.join(session.out, name + ".md")):
            lines.append("| [%s](%s.md) | %s (kept by hand) |" % (name, name, title))
    with open(os.path.join(session.out, "README.md"), "w") as file:
        file.write("\n".join(lines) + "\n")


def main():
    options, wanted = parse()
    command = " ".join(["scripts/results.sh"] + [a for a in sys.argv[1:] if not a.startswith("--knurl")])
    session = Session(options.knurl, options.level, options.out, options.scenes, command)
    start = time.monotonic()
    print(session.machine)
    print(reductions(session.level))
    for name in wanted:
        RESULTS[name](session)
    write_index(session)
    print("%s: %s, %.0f s" % (session.out, today(), time.monotonic() - start))


main()
