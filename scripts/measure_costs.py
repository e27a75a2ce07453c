#!/usr/bin/env python3
"""Where a frame goes: what a ray, a region that is seen, an empty region and a sample take, by encoding, in core-nanoseconds.

usage: scripts/measure_costs.py PROGRAM [--floor PROGRAM] [--experiment experiments/limits/costs.json] [--out out/costs]

Runs the experiment, or reads what is in the folder already, and fits to each encoding's points, of adaptive sampling and of lattice apart,
  time x cores = a rays + b visible regions + c empty regions + d samples,    a, b, c, d >= 0,
by least squares of relative residuals. Intervals are those of 95 % of 400 fits to points drawn again. The floor is the same march without a fetch:
a program whose shader makes values up from the region's range; without --floor it is built from a copy of the tree in build/mutations. Beside it
stands what reading the payload once takes on all cores.
"""

import argparse
import itertools
import json
import pathlib
import random
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy

import check_mutations
import experiment_runs

TERMS = ("ray", "visible region", "empty region", "sample")
DRAWS = 400
FIELD = "real fetch_field(IN(Region) r, IN(vec3r) q) { return fetch_value(r, 0, q); }\n"
# of the range where there is one, so that what is seen has light; changes with q, so that no compiler takes it out of a loop
MADE_UP = ("real fetch_field(IN(Region) r, IN(vec3r) q) {\n"
           "  real part = fract(q.x + q.y + q.z);\n"
           "  return AMRTEX_VALUE_RANGES != 0 ? r.value_range.x + (r.value_range.y - r.value_range.x) * part : part;\n}\n")


def counts(record):
    work = record["work"]
    return (work["rays"], work["regions"] - work["regions_skipped"], work["regions_skipped"], work["samples"])


def core_nanoseconds(record):
    return record["frame"]["wall_ms"]["median"] * 1e6 * record["context"]["cores"]


def fit(points):
    """Costs that are not below 0, of [(counts, time)]: the best of the fits to every choice of terms."""
    rows = numpy.array([numpy.array(c, float) / t for c, t in points])
    ones = numpy.ones(len(points))
    best, least = numpy.zeros(len(TERMS)), numpy.inf
    for size in range(1, len(TERMS) + 1):
        for chosen in itertools.combinations(range(len(TERMS)), size):
            costs, *_ = numpy.linalg.lstsq(rows[:, chosen], ones, rcond=None)
            residual = numpy.sum((rows[:, chosen] @ costs - 1) ** 2)
            if (costs >= 0).all() and residual < least:
                least = residual
                best = numpy.zeros(len(TERMS))
                best[list(chosen)] = costs
    return best, float(numpy.sqrt(least / len(points)))


def intervals(points, seed=1):
    draw = random.Random(seed)
    fits = numpy.array([fit(draw.choices(points, k=len(points)))[0] for _ in range(DRAWS)])
    return numpy.percentile(fits, 2.5, axis=0), numpy.percentile(fits, 97.5, axis=0)


def title(record):
    size = record["build_parameters"].get("page_size")
    return f"`{record['encoding']}`" + (f" p = {size}" if size else "") + f", `{record['filter']}`"


def by_encoding(records):
    """title, sampling -> [(counts, core-nanoseconds)]."""
    groups = {}
    for record in records:
        if record["status"] == "ok":
            groups.setdefault((title(record), record["render"]["sampling"]), []).append((counts(record), core_nanoseconds(record)))
    return groups


def measured(program, experiment, folder):
    folder = pathlib.Path(folder)
    done = subprocess.run([program, "run", experiment, "--out", str(folder), "--no-pictures"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"{program} run {experiment}: exit {done.returncode}\n{done.stdout}{done.stderr}")
    return experiment_runs.read_records(folder)


def build_floor(path):
    """The program that draws without a fetch, from a copy of the tree. Stencils of the octree are fetched all the same."""
    check_mutations.refresh_copy()
    change = {"name": "without fetches", "file": "shaders/contract.glsl", "before": FIELD, "after": MADE_UP}
    check_mutations.build_program(path, change)


def reading_milliseconds(size, cores):
    """Least time of nine in which all cores together copy `size` bytes, which no cache holds when it begins."""
    source = numpy.ones(max(size, 1), numpy.uint8)
    target = numpy.zeros_like(source)
    flush = numpy.zeros(256 << 20, numpy.uint8)
    cuts = numpy.linspace(0, len(source), cores + 1).astype(int)
    parts = list(zip(cuts, cuts[1:]))
    least = float("inf")
    with ThreadPoolExecutor(cores) as threads:
        for _ in range(9):
            flush += 1
            begin = time.perf_counter()
            list(threads.map(lambda p: numpy.copyto(target[p[0]:p[1]], source[p[0]:p[1]]), parts))
            least = min(least, time.perf_counter() - begin)
    return 1e3 * least


def number(value):
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}"


def cost_table(groups):
    lines = ["| encoding | sampling | points | " + " | ".join(TERMS) + " | residual |", "|---|---|---:|" + "---:|" * (len(TERMS) + 1)]
    for (name, sampling), points in groups.items():
        if len(points) <= len(TERMS):
            continue
        costs, residual = fit(points)
        low, high = intervals(points)
        cells = [f"{number(c)} ({number(a)} to {number(b)})" if max(p[0][i] for p in points) else "" for i, (c, a, b) in enumerate(zip(costs, low, high))]
        lines.append(f"| {name} | {sampling} | {len(points)} | " + " | ".join(cells) + f" | {100 * residual:.0f} % |")
    return lines


def asked(record):
    return json.dumps(experiment_runs.setting(record), sort_keys=True)


def floor_table(records, floor):
    """Of each encoding and sampling, at steps of one cell: the frame, the march without a fetch, and the payload once through the caches."""
    without = {asked(r): r for r in floor if r["status"] == "ok"}
    lines = ["| encoding | sampling | ms | ms without a fetch | share | ms to copy the payload |", "|---|---|---:|---:|---:|---:|"]
    for record in records:
        render = record["render"]
        if record["status"] != "ok" or render["width"] != 512 or render["step"] != 1 or render["view_name"] != "peers" or asked(record) not in without:
            continue
        frame, bare = (r["frame"]["wall_ms"]["median"] for r in (record, without[asked(record)]))
        payload = reading_milliseconds(record["memory"]["by_role"].get("payload", 0) + record["memory"]["by_role"].get("duplicated", 0),
                                       record["context"]["cores"])
        lines.append(f"| {title(record)} | {render['sampling']} | {frame:.0f} | {bare:.0f} | {bare / frame:.2f} | {payload:.1f} |")
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--floor", help="program that draws without a fetch")
    parser.add_argument("--experiment", default="experiments/limits/costs.json")
    parser.add_argument("--out", default="out/costs")
    a = parser.parse_args()
    out = pathlib.Path(a.out)
    out.mkdir(parents=True, exist_ok=True)
    floor_program = a.floor or out / "amrtex_without_fetches"
    if not a.floor and not floor_program.exists():
        build_floor(floor_program)
    records = measured(a.program, a.experiment, out / "measured")
    floor = measured(floor_program, a.experiment, out / "floor")
    text = ["core-ns of each, with intervals of 95 %:", "", *cost_table(by_encoding(records)), "",
            "The same march without a fetch (values made up from the region's range):", "", *cost_table(by_encoding(floor)), "",
            "Frames at steps of one cell, 512 x 512:", "", *floor_table(records, floor), "", experiment_runs.conditions(records[0]) + "."]
    (out / "costs.md").write_text("\n".join(text) + "\n", encoding="utf-8")
    print("\n".join(text))
    return 0


if __name__ == "__main__":
    sys.exit(main())
