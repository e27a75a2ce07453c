"""One job: its points, into a folder of its own.

  measure.py PLAN.json JOB JOBS PLACE COMMAND...     COMMAND: amrtex run EXPERIMENT and options

A point that fails is a record, and no failure of the job. A job that was cut off goes on where it stopped.
"""
import json
import os
import pathlib
import subprocess
import sys


def take_references(jobs, folder):
    """Pictures that are judged by depend on no machine, and other jobs may have drawn them: whole files only, which their writers rename to
    these names. The facts beside a picture come first, as a picture without them is drawn again."""
    own = folder / "references"
    own.mkdir(parents=True, exist_ok=True)
    for ending in ("*.json", "*.npy"):
        for file in jobs.glob(f"*/*/references/{ending}"):
            target = own / file.name
            if file.name.startswith(".") or target.exists():
                continue
            try:
                os.link(file, target)
            except OSError:  # somebody was faster, or the file system has no links
                pass


def main():
    plan, name, jobs, place, command = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3]), sys.argv[4], sys.argv[5:]
    with open(plan, encoding="utf-8") as text:
        job = json.load(text)[name]
    folder = jobs / place / name
    take_references(jobs, folder)
    run = subprocess.run([*command, "--out", str(folder), "--json", "--only", *job["only"]], stdout=subprocess.PIPE, check=False)
    try:
        counts = json.loads(run.stdout)
    except ValueError:  # it ended before it measured anything, or was cut off; what it said stands in the log
        sys.exit(run.returncode or 1)
    print(json.dumps(counts))
    done = sum(counts[key] for key in ("measured", "kept", "unsupported", "over_budget", "failed"))
    if counts["left"] > 0 or done == 0:
        sys.exit(f"measure.py: {done} points have a record, {counts['left']} are left")


if __name__ == "__main__":
    main()
