#!/usr/bin/env python3
"""From a file to its first picture, and memory, as the mesh grows: experiments/scale/results/first_frame.md.

usage: scripts/measure_scale.py PROGRAM [--sizes 5 6 7 8] [--repeat 3] [--data out/scale_data] [--out experiments/scale/results]

Makes plotfiles in single precision of the meshes of experiments/scale/cells.json, of 10^SIZE leaf cells (9 too: 10^9, not in the default run, since it
takes 6 GB of disk), where they are not there yet. Draws each with `amrtex render`, in a process of its own and with its files in the page cache, as
page table and kD-tree, in turn, and writes medians: wall time of the whole process, and the most memory it held, beside what was aimed at:
1.3 times the field in the file's type, the encoding's own bytes and 256 MiB.
"""

import argparse
import copy
import json
import os
import pathlib
import shutil
import statistics
import subprocess
import time

import numpy

import experiment_runs

ENCODINGS = {"`page_table` p = 8": {"name": "page_table", "page_size": 8, "filters": "linear_page"}, "`kd_tree`": {"name": "kd_tree", "filters": "linear_lod"}}
# the next of the row: what refines is the difference over a cell, which falls as edges grow
BILLION = {"field": "blobs_shell", "levels": 4, "root": 600, "refine": {"criterion": "gradient", "threshold": 0.01493}, "precision": "single"}
MIB = 1 << 20


def specification(experiment, size):
    if size == 9:
        return BILLION
    return next(d["generate"] for d in experiment["datasets"] if d["name"] == f"10^{size}")


def run(command):
    """Wall seconds, most memory held (bytes) and output of a command that succeeds."""
    begin = time.perf_counter()
    child = subprocess.Popen([str(c) for c in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    output = child.stdout.read()
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode != 0:
        raise SystemExit(f"{' '.join(map(str, command))}: exit {child.returncode}\n{output}")
    return time.perf_counter() - begin, usage.ru_maxrss * 1024, output


def plotfile(program, folder, experiment, size):
    """The data set's folder, and the seconds that generating it took; none where it was there."""
    target = folder / f"cells_{size}"
    if target.exists():
        return target, None
    folder.mkdir(parents=True, exist_ok=True)
    text = folder / f"cells_{size}.json"
    text.write_text(json.dumps(specification(experiment, size)))
    return target, run([program, "generate", text, "-o", target])[0]


def read_once(data):
    """All of its files, which are then in the page cache; their bytes."""
    total = 0
    for file in data.rglob("*"):
        if file.is_file():
            with open(file, "rb") as stream:
                while piece := stream.read(16 * MIB):
                    total += len(piece)
    return total


def scene_of(experiment, data, encoding):
    scene = copy.deepcopy(experiment)
    scene["datasets"] = {"name": data.name, "file": str(data.resolve())}
    scene["encodings"] = encoding
    return scene


def first_frames(program, data, experiment, folder, repeat):
    """Of each encoding its record, and the wall seconds and most memory of `repeat` processes that draw one frame; encodings in turn."""
    rows = []
    for name, encoding in ENCODINGS.items():
        scene = folder / f"{data.name}_{encoding['name']}.json"
        scene.write_text(json.dumps(scene_of(experiment, data, encoding)))
        out = folder / f"{data.name}_{encoding['name']}"
        shutil.rmtree(out, ignore_errors=True)
        run([program, "run", scene, "--out", out, "--no-pictures"])
        rows.append({"encoding": name, "scene": scene, "record": experiment_runs.read_records(out)[0], "seconds": [], "peak_bytes": []})
    for _ in range(repeat):
        for row in rows:
            seconds, peak, _ = run([program, "render", row["scene"], "-o", folder / "frame.npy"])
            row["seconds"].append(seconds)
            row["peak_bytes"].append(peak)
    return rows


def result(row, start_bytes, generate_seconds):
    record = row["record"]
    if record["status"] != "ok":
        raise SystemExit(f"{row['encoding']}: {record['reason']}")
    dataset, field = record["dataset"], 4 * record["dataset"]["stored_cells"]
    return {
        "encoding": row["encoding"], "leaf_cells": dataset["leaf_cells"], "field_bytes": field, "generate_seconds": generate_seconds,
        "file_to_frame_seconds": statistics.median(row["seconds"]), "all_seconds": row["seconds"],
        "build_seconds": record["build_seconds"], "upload_seconds": record["upload_seconds"],
        "frame_ms": record["frame"]["wall_ms"]["median"], "encoding_bytes": record["memory"]["total_bytes"],
        "pool_textures": record["statistics"].get("pool_textures"),
        "peak_bytes": statistics.median(row["peak_bytes"]) - start_bytes,
        "aim_bytes": 1.3 * field + record["memory"]["total_bytes"] + 256 * MIB, "conditions": experiment_runs.conditions(record)}


def table(results):
    lines = ["| leaf cells | encoding | textures | MiB | bytes a cell | build (s) | file to frame (s) | frame (ms) | peak (MiB) | aim (MiB) | generate (s) |",
             "|---:|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|"]
    for r in results:
        made = "" if r["generate_seconds"] is None else f"{r['generate_seconds']:.1f}"
        lines.append(f"| {r['leaf_cells']:,} | {r['encoding']} | {r['pool_textures']} | {r['encoding_bytes'] / MIB:.1f} | {r['encoding_bytes'] / r['leaf_cells']:.2f} "
                     f"| {r['build_seconds']:.2f} | {r['file_to_frame_seconds']:.2f} | {r['frame_ms']:.0f} | {r['peak_bytes'] / MIB:.0f} | {r['aim_bytes'] / MIB:.0f} | {made} |")
    return lines


# two-sided 95 % of Student's t, by degrees of freedom
STUDENT = {1: 12.71, 2: 4.30, 3: 3.18}


def exponent(cells, values):
    """Slope of log values over log cells, and the half-width of its 95 % interval."""
    x, y = numpy.log(cells), numpy.log(values)
    slope, offset = numpy.polyfit(x, y, 1)
    residual = numpy.sqrt(numpy.sum((y - slope * x - offset) ** 2) / (len(x) - 2) / numpy.sum((x - x.mean()) ** 2))
    return f"{slope:.2f} ± {STUDENT[len(x) - 2] * residual:.2f}"


def exponents(results):
    """From 10^6 cells on: below, what does not grow with them is the larger part."""
    lines = []
    for name in ENCODINGS:
        rows = [r for r in results if r["encoding"] == name and r["leaf_cells"] > 5e5]
        if len(rows) < 3:
            continue
        of = lambda key: exponent([r["leaf_cells"] for r in rows], [r[key] for r in rows])
        lines.append(f"{name}, from 10⁶ cells on: build grows as n^({of('build_seconds')}), file to frame as n^({of('file_to_frame_seconds')}), "
                     f"frame as n^({of('frame_ms')}), bytes as n^({of('encoding_bytes')}).")
    return lines


def page(results, repeat):
    return "\n".join(["# From a file to its first picture", "", *table(results), "", *exponents(results), "",
                      f"Medians of {repeat} processes. {results[0]['conditions']}. Made by `scripts/measure_scale.py`.", ""])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--sizes", type=int, nargs="+", default=[5, 6, 7, 8], choices=[5, 6, 7, 8, 9])
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--data", type=pathlib.Path, default=pathlib.Path("out/scale_data"))
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("experiments/scale/results"))
    a = parser.parse_args()
    experiment = experiment_runs.read_experiment("experiments/scale/cells.json")
    start_bytes = run([a.program, "--version"])[1]
    results = []
    for size in a.sizes:
        data, seconds = plotfile(a.program, a.data, experiment, size)
        read_once(data)
        results += [result(row, start_bytes, seconds) for row in first_frames(a.program, data, experiment, a.data, a.repeat)]
        print("\n".join(table(results[-len(ENCODINGS):])), flush=True)
    a.out.mkdir(parents=True, exist_ok=True)
    (a.out / "first_frame.md").write_text(page(results, a.repeat))
    (a.out / "first_frame.json").write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
