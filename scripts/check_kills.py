#!/usr/bin/env python3
"""Kills a sweep again and again, at random moments, and goes on with it: nothing may be lost, doubled, torn or left over.

usage: scripts/check_kills.py PROGRAM [--kills 200] [--seed 1] [--out FILE]

Half of the kills (SIGKILL) hit `amrtex run`, half the process in which it measures. When all points are there, records are compared with
those of a run that nobody disturbed, line by line: every checksum, bytes, errors and pictures to the bit. Then the next sweep begins.
"""

import argparse
import json
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import zlib

import experiment_runs

# what differs from run to run: times, and where and when they were taken
TIMES = {"frame", "build_seconds", "upload_seconds", "first_frame_ms", "process_peak_bytes", "context", "change"}


def experiment():
    """The encodings of quickstart, small enough for some seconds."""
    small = experiment_runs.read_experiment("experiments/quickstart/experiment.json")
    small["render"] = [{**render, "width": 48, "height": 48} for render in small["render"]]
    small.update(frames=2, warm_up=1)
    return small


def records_of(folder, problems):
    """Records by configuration; what is wrong with the file goes to `problems`."""
    found = {}
    text = (folder / "records.jsonl").read_text()
    if not text.endswith("\n"):
        problems.append("the last line is torn")
    for line in text.splitlines():
        entry = json.loads(line)
        # the checksum is over the record's own text, as it stands in the line
        own = line[len('{"record": '):line.rindex(', "crc32": ')]
        if f"{zlib.crc32(own.encode()):08x}" != entry["crc32"]:
            problems.append("a line does not fit its checksum")
        key = entry["record"]["configuration"]
        if key in found:
            problems.append(f"{key} stands twice")
        found[key] = {k: v for k, v in entry["record"].items() if k not in TIMES}
    return found


def children_of(process):
    path = pathlib.Path(f"/proc/{process}/task/{process}/children")
    return [int(word) for word in path.read_text().split()] if path.exists() else []


def leftovers(folder):
    return [str(p.relative_to(folder)) for p in folder.rglob(".unfinished-*")]


def different_files(folder, other):
    """Pictures and references that are not the same to the byte, or there once alone."""
    def files(of):
        return {str(p.relative_to(of)): p.read_bytes() for part in ("pictures", "references") for p in (of / part).iterdir()}
    one, two = files(folder), files(other)
    return sorted(name for name in one.keys() | two.keys() if one.get(name) != two.get(name))


class Sweep:
    def __init__(self, program, folder):
        self.folder = pathlib.Path(folder)
        self.file = self.folder / "experiment.json"
        self.file.write_text(json.dumps(experiment()))
        self.command = [program, "run", str(self.file), "--out"]

    def start(self, name):
        return subprocess.Popen([*self.command, str(self.folder / name)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def warm(self, name, like):
        """With the compiled shaders of another folder: a sweep takes seconds then, and kills hit more than compilers."""
        shutil.copytree(self.folder / like / "shader_cache", self.folder / name / "shader_cache")

    def finish(self, name):
        begin = time.monotonic()
        process = self.start(name)
        if process.wait() != 0:
            raise SystemExit(f"an undisturbed run ends with {process.returncode}")
        return time.monotonic() - begin


def kill_somebody(process, whom):
    """Did the kill hit what it was meant for?"""
    targets = [process.pid] if whom == "run" else children_of(process.pid)
    if not targets or process.poll() is not None:
        return False
    os.kill(targets[0], signal.SIGKILL)
    return True


def torture(sweep, kills, chance):
    """Problems, and how many kills hit whom."""
    sweep.finish("undisturbed")
    sweep.warm("again", "undisturbed")
    whole = sweep.finish("again")
    problems, hits, sweeps = [], {"run": 0, "child": 0}, 0
    expected = records_of(sweep.folder / "undisturbed", problems)
    while sum(hits.values()) < kills:
        name = f"tortured_{sweeps}"
        sweeps += 1
        sweep.warm(name, "undisturbed")
        for _ in range(12):  # then it may end in peace
            process = sweep.start(name)
            whom = chance.choice(("run", "child"))
            time.sleep(chance.uniform(0, whole * 0.6))
            if kill_somebody(process, whom):
                hits[whom] += 1
            process.wait()  # a run whose child was killed goes on with another
        sweep.finish(name)
        found = records_of(sweep.folder / name, problems)
        for key in sorted(set(expected) | set(found)):
            if key not in found or key not in expected:
                problems.append(f"sweep {sweeps}: {key} is {'lost' if key not in found else 'nobody asked for'}")
            elif found[key] != expected[key]:
                differing = [k for k in expected[key] if expected[key][k] != found[key].get(k)]
                problems.append(f"sweep {sweeps}: {key} differs in {', '.join(differing)}")
        problems += [f"sweep {sweeps}: {file} differs" for file in different_files(sweep.folder / "undisturbed", sweep.folder / name)]
        problems += [f"sweep {sweeps}: left over: {file}" for file in leftovers(sweep.folder / name)]
        print(f"{sum(hits.values())} kills, {sweeps} sweeps, {len(problems)} problems", file=sys.stderr)
    return problems, hits, sweeps, len(expected)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", help="Markdown file for the outcome")
    a = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        problems, hits, sweeps, points = torture(Sweep(a.program, folder), a.kills, random.Random(a.seed))
        conditions = experiment_runs.conditions(experiment_runs.read_records(pathlib.Path(folder) / "undisturbed")[0])
    text = (f"{hits['run']} kills of `amrtex run` and {hits['child']} of its measuring process, over {sweeps} sweeps of {points} points: "
            f"{len(problems)} records lost, doubled, torn or different, or files left over.\n")
    text += "".join(f"- {p}\n" for p in problems)
    print(text, end="")
    if a.out:
        made_by = f"Made by `scripts/check_kills.py`, seed {a.seed}: quickstart at 48 x 48, {conditions}."
        pathlib.Path(a.out).write_text(f"# Kills\n\n{made_by}\n\n{text}")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
