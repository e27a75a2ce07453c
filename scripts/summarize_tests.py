#!/usr/bin/env python3
"""Prints what a person wants to know of a test run: how many passed, the ten slowest, what was skipped and why.

usage: summarize_tests.py RESULTS.xml     (as `ctest --output-junit` writes it)
"""
import re
import sys
import xml.etree.ElementTree as ElementTree

SLOWEST = 10


def why_skipped(case):
    """The reason that the test itself printed: the line before GoogleTest's mark, or the first one."""
    text = case.findtext("system-out") or ""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    for before, line in zip(lines, lines[1:]):
        if line.startswith("[  SKIPPED ]") and not before.startswith("["):
            return re.sub(r"^\S+:\d+: ", "", before)
    return lines[0] if lines else "no reason given"


def main(path):
    cases = list(ElementTree.parse(path).getroot().iter("testcase"))
    skipped = [case for case in cases if case.find("skipped") is not None]
    failed = [case for case in cases if case.find("failure") is not None]
    print(f"{len(cases)} tests: {len(cases) - len(skipped) - len(failed)} passed, {len(skipped)} skipped, {len(failed)} failed")
    print(f"the {SLOWEST} slowest:")
    for case in sorted(cases, key=lambda case: -float(case.get("time", 0)))[:SLOWEST]:
        print(f"  {float(case.get('time', 0)):7.1f} s  {case.get('name')}")
    reasons = {}
    for case in skipped:
        reasons.setdefault(why_skipped(case), []).append(case.get("name"))
    if reasons:
        print("skipped:")
    for reason, names in reasons.items():
        others = f" and {len(names) - 1} more" if len(names) > 1 else ""
        print(f"  {names[0]}{others}: {reason}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(sys.argv[1])
