#!/usr/bin/env python3
"""Is `amrtex compare` right? Pairs of runs of one program, in which it may call next to nothing, and of programs that are slower by a planted
tenth, in one encoding or in all with the baseline, which it must find.

usage: scripts/check_comparisons.py [--trials 20] [--repeat 8] [--equal-repeat 5] [--out experiments/verify/results/comparisons.md]

The slower programs are built from a copy of the tree in build/mutations, whose shader does some idle work a sample; how much is found by
measuring. All programs are measured in turns, one process each at a time. What is measured stays in build/comparisons: a run that was
interrupted goes on.
"""

import argparse
import json
import pathlib
import shutil
import statistics
import subprocess
import sys

import check_mutations
import experiment_runs

WORK = check_mutations.ROOT / "build/comparisons"
PLANTED = 0.10
SLOW_ENCODING = "kd_tree"

# work that changes no value and that no compiler can leave out
IDLE = """  real idle = q.x;
  for (int i = 0; i < {turns}; ++i) idle = idle * real(0.75) + q.y;
  if (idle > real(1e30)) return idle;
"""
FETCH = "real fetch_value(IN(Region) r, IN(int) field, IN(vec3r) q) {\n"
FIELD = "real fetch_field(IN(Region) r, IN(vec3r) q) { return fetch_value(r, 0, q); }\n"
FAULTS = {
    "one": {"file": f"structures/{SLOW_ENCODING}/{SLOW_ENCODING}.glsl", "before": FETCH, "after": FETCH + IDLE},
    "all": {"file": "shaders/contract.glsl", "before": FIELD,
            "after": "real fetch_field(IN(Region) r, IN(vec3r) q) {\n" + IDLE + "  return fetch_value(r, 0, q);\n}\n"},
}


def experiment():
    """24 points of five encodings, a few milliseconds a frame."""
    small = experiment_runs.read_experiment("experiments/quickstart/experiment.json")
    small.update(name="comparisons", frames=5, warm_up=1, baseline=True, reference=None)
    small["render"] = {"mode": "dvr", "sampling": "lattice", "skip": False, "step": [1.0, 0.5], "width": 96, "height": 96}
    small["encodings"] = [{"name": "uniform", "filters": ["nearest", "linear_page", "linear_vertex"]},
                          {"name": "page_table", "page_size": 16, "filters": ["nearest", "linear_page"]},
                          {"name": "octree", "filters": ["nearest", "linear_lod"], "filtering": "manual"},
                          {"name": SLOW_ENCODING, "filters": ["nearest", "linear_lod", "linear_vertex"]},
                          {"name": "exabricks", "filters": ["nearest", "basis"]}]
    for key in ("filters", "storage", "filtering", "check"):
        small.pop(key, None)
    small.update(storage="r32f", filtering="hardware")
    return small


class Programs:
    """The plain program and the slower ones, by name."""

    def __init__(self):
        self.turns = json.loads((WORK / "turns.json").read_text()) if (WORK / "turns.json").exists() else {}

    def path(self, name):
        return WORK / f"amrtex_{name}"

    def build(self, name, turns=None):
        fault = FAULTS.get(name)
        change = {**fault, "name": name, "after": fault["after"].format(turns=turns)} if fault else None
        check_mutations.build_program(self.path(name), change)


class Folder:
    """Where one program's processes of one trial leave their records."""

    def __init__(self, programs, name, trial):
        self.program = programs.path("plain" if name == "again" else name)
        self.path = WORK / f"trial_{trial}" / name

    def run(self, repeat):
        if not self.path.exists():
            cache = WORK / "shader_cache" / self.program.name
            if cache.exists():
                shutil.copytree(cache, self.path / "shader_cache")
        done = subprocess.run([self.program, "run", WORK / "experiment.json", "--out", self.path, "--repeat", str(repeat), "--no-pictures"],
                              capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise SystemExit(f"{self.program} run: exit {done.returncode}\n{done.stdout}{done.stderr}")

    def keep_cache(self):
        shutil.copytree(self.path / "shader_cache", WORK / "shader_cache" / self.program.name, dirs_exist_ok=True)


def encoding_of(setting):
    return json.loads(dict(setting)["encoding"])


def slowdown(programs, name):
    """Of the points that the fault is meant for: how much longer their frames take, by the median of some processes in turns."""
    folders = [Folder(programs, "plain", f"calibration_{name}"), Folder(programs, name, f"calibration_{name}")]
    for folder in folders:
        shutil.rmtree(folder.path, ignore_errors=True)
    for repeat in range(1, 5):
        for folder in folders:
            folder.run(repeat)
    for folder in folders:
        folder.keep_cache()
    ratios = []
    medians = [by_point(folder) for folder in folders]
    for point, times in medians[0].items():
        if name == "one" and encoding_of(point) != SLOW_ENCODING:
            continue
        ratios.append(statistics.median(medians[1][point]) / statistics.median(times))
    return statistics.median(ratios) - 1


def by_point(folder):
    times = {}
    for record in experiment_runs.read_records(folder.path):
        times.setdefault(tuple(sorted(experiment_runs.setting(record).items())), []).append(record["frame"]["wall_ms"]["median"])
    return times


def plant(programs, name):
    """Builds the slower program with as much idle work as takes a tenth of the time."""
    turns = 8
    for _ in range(6):
        programs.build(name, turns)
        found = slowdown(programs, name)
        print(f"{name}: {turns} turns of idle work take {found:.3f} of a frame", file=sys.stderr)
        if 0.09 <= found <= 0.115:
            break
        turns = max(1, round(turns * PLANTED / max(found, 0.01)))
    programs.turns[name] = {"turns": turns, "slowdown": found}
    (WORK / "turns.json").write_text(json.dumps(programs.turns))


def compared(a, b, most):
    """`amrtex compare` of two folders, of their first `most` processes."""
    folders = []
    for folder in (a, b):
        part = folder.path.parent / f"{folder.path.name}_first_{most}"
        part.mkdir(exist_ok=True)
        lines = (folder.path / "records.jsonl").read_text().splitlines(keepends=True)
        (part / "records.jsonl").write_text("".join(line for line in lines if json.loads(line)["record"]["repetition"] < most))
        folders.append(part)
    done = subprocess.run([a.program, "compare", *folders, "--json"], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise SystemExit(f"compare: exit {done.returncode}\n{done.stderr}")
    return json.loads(done.stdout)


def called(rows):
    return [row for row in rows if row["verdict"] in ("faster", "slower")]


def judge(programs, trial, a):
    """What the comparisons of one trial say."""
    plain, again, one, everything = (Folder(programs, name, trial) for name in ("plain", "again", "one", "all"))
    for repeat in range(1, a.repeat + 1):
        for folder in (plain, again, one, everything) if repeat % 2 else (everything, one, again, plain):
            folder.run(repeat)
    equal = {n: compared(plain, again, n) for n in {a.equal_repeat, a.repeat}}
    slow, common = compared(plain, one, a.repeat), compared(plain, everything, a.repeat)
    lines = {line["name"]: line["verdict"] for line in slow["encodings"]}
    return {
        "points": len(slow["points"]),
        "equal": {str(n): len(called(c["points"])) for n, c in equal.items()},
        "equal_lines": {str(n): len(called(c["encodings"])) + len(called(c["baselines"])) for n, c in equal.items()},
        "one_points": sum(p["verdict"] == "slower" and p["encoding"] == SLOW_ENCODING for p in slow["points"]),
        "one_false": sum(p["encoding"] != SLOW_ENCODING for p in called(slow["points"])),
        "one_line": lines[SLOW_ENCODING],
        "all_baseline": [line["verdict"] for line in common["baselines"]],
        "all_false": len(called(common["points"])),
    }


def report(programs, results, a):
    n = len(results)
    points = results[0]["points"]
    one = sum(r["one_line"] == "slower" or r["one_points"] > 0 for r in results)
    everything = sum("slower" in r["all_baseline"] for r in results)
    conditions = experiment_runs.conditions(experiment_runs.read_records(WORK / "trial_0" / "plain")[0])
    text = ["# Comparisons of runs", "", f"Made by `scripts/check_comparisons.py`: 96 x 96, {points} points, {n} trials, all programs measured in "
            f"turns, {conditions}.", "", "| what | expected | found |", "|---|---|---|"]
    for repeat in sorted({a.equal_repeat, a.repeat}):
        wrong = sum(r["equal"][str(repeat)] for r in results)
        lines = sum(r["equal_lines"][str(repeat)] for r in results)
        text.append(f"| one program twice, `--repeat {repeat}`: points called slower or faster | at most 5 % | {wrong} of {n * points} "
                    f"({100 * wrong / (n * points):.1f} %); lines of encodings and baselines: {lines} |")
    text.append(f"| {SLOW_ENCODING} slower by {100 * programs.turns['one']['slowdown']:.0f} %, `--repeat {a.repeat}`: found | at least 18 of 20 | "
                f"{one} of {n}; points of it called: {sum(r['one_points'] for r in results)}; points of others called: "
                f"{sum(r['one_false'] for r in results)} |")
    text.append(f"| all slower by {100 * programs.turns['all']['slowdown']:.0f} %, the baseline too, `--repeat {a.repeat}`: found as a line of "
                f"its own | at least 18 of 20 | {everything} of {n}; points called beside it: {sum(r['all_false'] for r in results)} |")
    good = all(sum(r["equal"][str(k)] for r in results) <= 0.05 * n * points for k in {a.equal_repeat, a.repeat})
    return "\n".join(text) + "\n", good and one >= 0.9 * n and everything >= 0.9 * n


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--repeat", type=int, default=8)
    parser.add_argument("--equal-repeat", type=int, default=5)
    parser.add_argument("--out", default="experiments/verify/results/comparisons.md")
    a = parser.parse_args()
    WORK.mkdir(parents=True, exist_ok=True)
    (WORK / "experiment.json").write_text(json.dumps(experiment()))
    programs = Programs()
    if not programs.path("plain").exists():
        check_mutations.refresh_copy()
        programs.build("plain")
    for name in FAULTS:
        if name not in programs.turns:
            plant(programs, name)
    kept = WORK / "results.json"
    results = json.loads(kept.read_text()) if kept.exists() else []
    while len(results) < a.trials:
        results.append(judge(programs, len(results), a))
        kept.write_text(json.dumps(results, indent=1))
        print(f"trial {len(results)}: {results[-1]}", file=sys.stderr)
    text, good = report(programs, results[:a.trials], a)
    (check_mutations.ROOT / a.out).write_text(text)
    print(text, end="")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
