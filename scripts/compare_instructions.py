#!/usr/bin/env python3
"""Compares how many instructions a frame takes in two programs, on a small form of the scene of experiments/limits.

usage: scripts/compare_instructions.py PROGRAM OTHER [--size 64] [--levels 2] [--only WORD] [--out FILE]

Valgrind counts the whole program with two frames and with 22; a twentieth of the difference is a frame, of the CPU that llvmpipe's
shaders run on. What a run counts beside its frames differs by a million instructions or two from one run to the next, so few frames
tell nothing. Nothing else that goes on changes the count: where frame times are too noisy to tell two programs apart, this does. It
says nothing of memory and caches.
"""

import argparse
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import compare_times

FRAMES = (2, 22)
# one thread, vectors that valgrind knows, and a compiler that never takes a shader from an earlier run
ENVIRONMENT = {"LP_NUM_THREADS": "1", "LP_NATIVE_VECTOR_WIDTH": "256", "GALLIUM_OVERRIDE_CPU_CAPS": "avx2",
               "MESA_SHADER_CACHE_DISABLE": "true"}


def instructions(program, experiment):
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "experiment.json"
        file.write_text(json.dumps(experiment))
        valgrind = ["valgrind", "--tool=callgrind", "--trace-children=yes", "--callgrind-out-file=/dev/null", f"--log-file={folder}/log.%p"]
        done = subprocess.run([*valgrind, program, "run", str(file), "--out", str(pathlib.Path(folder) / "out")], capture_output=True,
                              text=True, env={**os.environ, **ENVIRONMENT}, check=False)
        # of the run, and of the process that it measures in
        counted = [n for log in pathlib.Path(folder).glob("log.*") for n in re.findall(r"Collected : (\d+)", log.read_text())]
        if done.returncode != 0 or not counted:
            raise SystemExit(f"{program}: exit {done.returncode}\n{done.stdout}{done.stderr}")
        return sum(map(int, counted))


def points(experiments):
    """Each encoding and sampling on its own: title -> experiment by number of frames."""
    for encoding in experiments[FRAMES[0]]["encodings"]:
        for number in range(len(experiments[FRAMES[0]]["render"])):
            name = f"{encoding['name']} {encoding['filters']} {experiments[FRAMES[0]]['render'][number]['sampling']}"
            yield name, {f: {**e, "encodings": [encoding], "render": [e["render"][number]]} for f, e in experiments.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("other")
    parser.add_argument("--size", type=int, default=64)
    parser.add_argument("--levels", type=int, default=2)
    parser.add_argument("--only", default="", help="points whose name holds this word")
    parser.add_argument("--out", help="JSON file for all counts")
    a = parser.parse_args()
    rows = []
    print("| point | instructions a frame | other / program |\n|---|---:|---:|")
    for name, experiment in points({f: compare_times.timing_experiment(a.levels, a.size, f) for f in FRAMES}):
        if a.only not in name:
            continue
        counts = {p: [instructions(p, experiment[f]) for f in FRAMES] for p in (a.program, a.other)}
        frames = [(c[1] - c[0]) / (FRAMES[1] - FRAMES[0]) for c in counts.values()]
        rows.append({"point": name, "program": frames[0], "other": frames[1]})
        print(f"| {name} | {frames[0]:.4g} | {frames[1] / frames[0]:.4f} |", flush=True)
        if a.out:
            pathlib.Path(a.out).write_text(json.dumps({"levels": a.levels, "size": a.size, "rows": rows}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
