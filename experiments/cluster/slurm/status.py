#!/usr/bin/env python3
"""What became of a job of Slurm, for Snakemake: prints running, success or failed. The controller remembers a job for minutes after its end
(MinJobAge), and Snakemake asks more often than that."""
import re
import subprocess
import sys

OVER = {"BOOT_FAIL", "CANCELLED", "DEADLINE", "FAILED", "NODE_FAIL", "OUT_OF_MEMORY", "PREEMPTED", "TIMEOUT"}


def main():
    job = sys.argv[1].split(";")[0]  # "id;cluster"
    shown = subprocess.run(["scontrol", "--oneliner", "show", "job", job], capture_output=True, text=True, check=False)
    state = re.search(r"\bJobState=(\w+)", shown.stdout)
    if state is None:
        # forgotten: Snakemake starts it again, which measures what is missing. A controller that does not answer may do so later.
        print("failed" if "Invalid job id" in shown.stderr else "running")
    elif state.group(1) == "COMPLETED":
        print("success")
    else:
        print("failed" if state.group(1) in OVER else "running")


if __name__ == "__main__":
    main()
