#!/usr/bin/env python3
"""Compares the frame times of two programs on the scene of experiments/limits, in alternating runs, and one beside itself.

usage: scripts/compare_times.py PROGRAM OTHER [--levels 4] [--size 512] [--frames 5] [--least 20] [--most 100] [--half-width 0.02]
                                [--minutes M] [--out FILE]

In each round PROGRAM runs, OTHER, and PROGRAM once more, in an order that turns from round to round. Prints one row a point: the
ratio OTHER / PROGRAM of the medians (the geometric mean over the rounds) with its 95 % interval, and the same of PROGRAM beside
itself, which shows what the machine does. Rounds are run until the interval of every point is narrow enough.
"""

import argparse
import json
import math
import statistics
import sys
import time

import experiment_runs

ENCODINGS = [
    {"name": "uniform", "filters": "linear_page"},
    {"name": "page_table", "page_size": 16, "filters": "linear_page"},
    {"name": "octree", "filters": "nearest", "filtering": "manual"},
    {"name": "octree", "filters": "linear_lod", "filtering": "manual"},
    {"name": "kd_tree", "filters": "linear_lod"},
    {"name": "exabricks", "filters": "basis"},
]
RENDER = [{"sampling": "lattice", "skip": False}, {"sampling": "adaptive", "skip": True}]

# 97.5 % points of Student's t; between two rows the smaller number of rounds counts
STUDENT_T = {1: 12.71, 2: 4.303, 3: 3.182, 4: 2.776, 5: 2.571, 6: 2.447, 7: 2.365, 8: 2.306, 9: 2.262, 10: 2.228, 12: 2.179,
             15: 2.131, 19: 2.093, 25: 2.060, 30: 2.042, 40: 2.021, 60: 2.000, 100: 1.984}


def student_t(freedom):
    return STUDENT_T[max(f for f in STUDENT_T if f <= freedom)]


def interval(ratios):
    """Geometric mean of the ratios and the ends of its 95 % interval."""
    logs = [math.log(r) for r in ratios]
    mean = statistics.fmean(logs)
    if len(logs) < 2:
        return math.exp(mean), 0.0, math.inf
    half = student_t(len(logs) - 1) * statistics.stdev(logs) / math.sqrt(len(logs))
    return math.exp(mean), math.exp(mean - half), math.exp(mean + half)


def half_width(ratios):
    _, low, high = interval(ratios)
    return (high - low) / 2


def timing_experiment(levels, size, frames):
    experiment = experiment_runs.read_experiment("experiments/limits/experiment.json")
    render = {k: v for k, v in experiment["render"].items() if k not in ("sampling", "skip")}
    render.update(width=size, height=size)
    experiment.update(name="compare_times", encodings=ENCODINGS, frames=frames, warm_up=1, baseline=False, reference=None,
                      datasets=[{"name": "blobs_shell", "generate": {"field": "blobs_shell", "levels": levels}}],
                      render=[{**render, **r} for r in RENDER])
    return experiment


def medians(program, experiment):
    """Median frame time in milliseconds of each point, by its title."""
    records = experiment_runs.run(program, experiment)
    failed = [r for r in records if r["status"] != "ok"]
    if failed:
        raise SystemExit(f"{program}: {experiment_runs.title(failed[0])}: {failed[0]['status']}: {failed[0]['reason']}")
    return {experiment_runs.title(r): r["frame"]["wall_ms"]["median"] for r in records}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("other")
    parser.add_argument("--levels", type=int, default=4, help="of the mesh; 4 is the 512^3 of the experiment")
    parser.add_argument("--size", type=int, default=512, help="of the picture, in pixels a side")
    parser.add_argument("--frames", type=int, default=5, help="timed frames of each point and run")
    parser.add_argument("--least", type=int, default=20, help="rounds at least")
    parser.add_argument("--most", type=int, default=100, help="rounds at most")
    parser.add_argument("--half-width", type=float, default=0.02, help="of the ratio's interval, at which a point is done")
    parser.add_argument("--minutes", type=float, default=math.inf, help="no further round is begun after as many")
    parser.add_argument("--out", help="JSON file for all medians and ratios")
    return parser.parse_args()


ROLES = ("program", "other", "again")


def one_round(a, experiment, number):
    """Medians by role. Who begins turns from round to round, so that a machine that grows faster or slower favours none."""
    turn = number % 3
    programs = {"program": a.program, "other": a.other, "again": a.program}
    return {role: medians(programs[role], experiment) for role in ROLES[turn:] + ROLES[:turn]}


def ratios_to_program(rounds, role):
    """Ratio of a role's time to the program's, by point, one a round."""
    return {point: [r[role][point] / r["program"][point] for r in rounds] for point in rounds[0]["program"]}


def measure(a):
    experiment = timing_experiment(a.levels, a.size, a.frames)
    end = time.monotonic() + 60 * a.minutes
    rounds = []
    while len(rounds) < a.most and time.monotonic() < end:
        rounds.append(one_round(a, experiment, len(rounds)))
        widest = max(half_width(r) for r in ratios_to_program(rounds, "other").values())
        print(f"round {len(rounds)}: widest half-width {widest:.4f}", file=sys.stderr)
        if len(rounds) >= a.least and widest < a.half_width:
            break
    return rounds


def cell(ratios):
    ratio, low, high = interval(ratios)
    return f"{ratio:.3f} ({low:.3f} to {high:.3f})"


def print_table(a, rounds):
    other, again = ratios_to_program(rounds, "other"), ratios_to_program(rounds, "again")
    print(f"{len(rounds)} rounds; {a.levels} levels, {a.size} x {a.size}, median of {a.frames} frames a run\n")
    print("| point | ms | other / program | program / itself |\n|---|---:|---|---|")
    for point in other:
        milliseconds = statistics.median(r["program"][point] for r in rounds)
        print(f"| {point} | {milliseconds:.1f} | {cell(other[point])} | {cell(again[point])} |")


def main():
    a = arguments()
    rounds = measure(a)
    print_table(a, rounds)
    if a.out:
        with open(a.out, "w", encoding="utf-8") as file:
            json.dump({"levels": a.levels, "size": a.size, "frames": a.frames, "rounds": rounds}, file, indent=1)
    return 0


if __name__ == "__main__":
    sys.exit(main())
