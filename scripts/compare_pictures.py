#!/usr/bin/env python3
"""Lists the hash of every picture of three experiments: quickstart, modes and limits/scene.json. With two programs, says which
pictures differ between them, and ends with 1 where any does.

usage: scripts/compare_pictures.py PROGRAM [OTHER]
"""

import sys

import experiment_runs

EXPERIMENTS = ("experiments/quickstart/experiment.json", "experiments/modes/experiment.json", "experiments/limits/scene.json")


def pictures(program):
    """Per experiment its records, each drawn once: no time is wanted, and no reference changes a picture."""
    lists = {}
    for path in EXPERIMENTS:
        experiment = experiment_runs.read_experiment(path)
        experiment.update(frames=1, warm_up=0, reference=None)
        experiment.pop("check", None)  # of errors, which nobody computes here
        lists[path] = experiment_runs.run(program, experiment)
    return lists


def identities(records, other_records):
    """Per record the setting that it was asked for, in the keys that every record of both lists has: a newer program may know more."""
    settings = [experiment_runs.setting(r) for r in records]
    keys = set.intersection(*(set(experiment_runs.setting(r)) for r in records + other_records))
    return [tuple((k, s[k]) for k in sorted(keys)) for s in settings]


def compare(records, other_records):
    """(equal pictures, lines that say what differs)"""
    def table(of, others):
        hashes = {}
        for identity, r in zip(identities(of, others), of):
            hashes.setdefault(identity, []).append((r["image_hash"] or r["status"], experiment_runs.title(r)))
        return {k: sorted(v) for k, v in hashes.items()}

    mine, theirs = table(records, other_records), table(other_records, records)
    equal, lines = 0, []
    for identity in sorted(set(mine) | set(theirs)):
        first, second = mine.get(identity, []), theirs.get(identity, [])
        if [h for h, _ in first] == [h for h, _ in second]:
            equal += len(first)
        else:
            name = (first or second)[0][1]
            lines.append(f"{name}: {', '.join(h for h, _ in first) or 'no record'} | {', '.join(h for h, _ in second) or 'no record'}")
    return equal, lines


def main(programs):
    if len(programs) not in (1, 2):
        raise SystemExit(__doc__.strip())
    first = pictures(programs[0])
    if len(programs) == 1:
        for path, records in first.items():
            print(path)
            for line in sorted(f"{r['image_hash'] or r['status']}  {experiment_runs.title(r)}" for r in records):
                print("  " + line)
        return 0
    second = pictures(programs[1])
    different = 0
    for path in EXPERIMENTS:
        equal, lines = compare(first[path], second[path])
        different += len(lines)
        print(f"{path}: {equal} pictures equal, {len(lines)} differ")
        for line in lines:
            print("  " + line)
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
