"""Which points go into which job.

  plan.py PLAN.json POINTS COMMAND...     COMMAND: amrtex run EXPERIMENT --out DIR and options

A structure is built once, so its points stay in one job; whole structures of one data set are put together until a job has POINTS points.
Writes {"job": {"dataset": name, "only": [configuration, ...]}, ...}, a job named by its points.
"""
import hashlib
import json
import subprocess
import sys


def structure_of(point):
    """What is built for it."""
    settings = point["settings"]
    return json.dumps([settings[key] for key in ("dataset", "encoding", "build_parameters", "filter", "storage", "filtering")], sort_keys=True)


def jobs_of(points, least):
    structures = {}
    for point in points:
        structures.setdefault(structure_of(point), []).append(point)
    jobs, open_jobs = [], {}
    for members in structures.values():
        dataset = members[0]["settings"]["dataset"]["name"]
        job = open_jobs.setdefault(dataset, {"dataset": dataset, "only": []})
        job["only"] += [point["configuration"] for point in members if point["configuration"] not in job["only"]]
        if len(job["only"]) >= least:
            jobs.append(open_jobs.pop(dataset))
    return jobs + list(open_jobs.values())


def main():
    plan, least, command = sys.argv[1], int(sys.argv[2]), sys.argv[3:]
    listed = subprocess.run([*command, "--list-points", "--json"], stdout=subprocess.PIPE, check=False)
    if listed.returncode != 0:
        sys.exit(listed.returncode)
    jobs = jobs_of(json.loads(listed.stdout), least)
    named = {hashlib.sha256(" ".join(sorted(job["only"])).encode()).hexdigest()[:16]: job for job in jobs}
    with open(plan, "w", encoding="utf-8") as out:
        json.dump(named, out, indent=1)


if __name__ == "__main__":
    main()
