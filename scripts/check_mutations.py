#!/usr/bin/env python3
"""Builds each fault of tests/mutations/mutations.json and says which suite notices it.

usage: scripts/check_mutations.py [--only WORD] [--again] [--out experiments/verify/results/mutations.md]

Works on a copy of the tree in build/mutations, where results are kept: a run that was interrupted goes on. Ends with 1 where a fault is
not noticed.
"""

import argparse
import contextlib
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
WORK = ROOT / "build/mutations"
COPY = WORK / "source"
BUILD = WORK / "build"

# what is asked, in this order: first what takes the least time
SUITES = ("analytic", "differential", "geometry", "metamorphic", "stiff", "convergence", "scales", "reference", "extreme")
# asked where no suite noticed; the same names as their targets
TESTS = ("analytic_test", "conformance_test", "isosurface_test", "integrator_test", "shadow_test", "level_of_detail_test", "octree_test",
         "page_table_test", "kd_tree_test", "uniform_test", "exabricks_test", "leave_out_test")

# seconds; a suite takes one minute, and some faults make a ray endless
LONGEST = 600


def tracked_files():
    listed = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True,
                            check=True)
    return [name for name in listed.stdout.split("\n") if name and (ROOT / name).is_file()]


def refresh_copy():
    """The tree as it is now; files that did not change keep their times, so that little is built again."""
    for name in tracked_files():
        source, target = ROOT / name, COPY / name
        if not target.exists() or target.read_bytes() != source.read_bytes():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)


def build(targets):
    """None, or why it does not compile."""
    if not (BUILD / "build.ninja").exists():
        subprocess.run(["cmake", "-S", str(COPY), "-B", str(BUILD), "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release"],
                       stdout=subprocess.DEVNULL, check=True)
    done = subprocess.run(["ninja", "-C", str(BUILD), *targets], capture_output=True, text=True, check=False)
    return None if done.returncode == 0 else done.stdout[-2000:]


def ask(command):
    """What a suite or test says; None where it does not end."""
    environment = {**os.environ, "MESA_SHADER_CACHE_DIR": str(WORK / "shader_cache")}
    try:
        return subprocess.run(command, cwd=COPY, capture_output=True, text=True, env=environment, timeout=LONGEST, check=False)
    except subprocess.TimeoutExpired:
        return None


def failing_cases(suite):
    """Cases of a suite of `amrtex verify` that fail, one line each."""
    done = ask([BUILD / "amrtex", "verify", "--suite", suite, "--json"])
    if done is None:
        return ["does not end"]
    if done.returncode == 0:
        return []
    try:
        cases = json.loads(done.stdout)["cases"]
    except (json.JSONDecodeError, KeyError):
        return [f"exit {done.returncode}: {(done.stderr.strip().splitlines() or ['no message'])[-1][:200]}"]
    return [f"{c['name']}, {c['encoding']} {c['filter']}" for c in cases if not c["pass"]]


def failing_tests(name):
    done = ask([next(BUILD.rglob(name)), "--gtest_brief=1"])
    if done is None:
        return ["does not end"]
    if done.returncode == 0:
        return []
    failed = [line.split()[2].rstrip(",") for line in done.stdout.splitlines() if line.startswith("[  FAILED  ] ") and "(" in line]
    return failed or [f"exit {done.returncode}"]


def who_notices():
    """(suite or test, its failing cases); the build is that of the mutation."""
    error = build(["amrtex"])
    if error:
        return "compiler", [error.strip().splitlines()[-1]]
    for suite in SUITES:
        if failed := failing_cases(suite):
            return f"verify --suite {suite}", failed
    for test in TESTS:
        error = build([test])
        if error:
            return "compiler", [error.strip().splitlines()[-1]]
        if failed := failing_tests(test):
            return test, failed
    return None, []


@contextlib.contextmanager
def planted(change):
    """The copy with `after` in place of `before` in a `file`, as long as the block lasts."""
    file = COPY / change["file"]
    text = file.read_text(encoding="utf-8")
    if text.count(change["before"]) != 1:
        raise SystemExit(f"{change['name']}: its line stands {text.count(change['before'])} times in {change['file']}; once is accepted")
    file.write_text(text.replace(change["before"], change["after"]), encoding="utf-8")
    try:
        yield
    finally:
        file.write_text(text, encoding="utf-8")


def build_program(path, change=None):
    """`amrtex` of the copy, with a change or as it is, at `path`."""
    with planted(change) if change else contextlib.nullcontext():
        error = build(["amrtex"])
    if error:
        raise SystemExit(error)
    shutil.copy2(next(BUILD.rglob("amrtex")), path)


def try_mutation(mutation):
    with planted(mutation):
        suite, failed = who_notices()
    return {"noticed_by": suite, "cases": len(failed), "first": failed[0] if failed else ""}


def identity(mutation):
    """Changes with the mutation and with what it is tried on."""
    text = json.dumps(mutation, sort_keys=True) + (ROOT / mutation["file"]).read_text(encoding="utf-8")
    return hashlib.sha256(text.encode()).hexdigest()


def table(mutations, results):
    lines = ["# Mutations and who notices them", "", "Made by `scripts/check_mutations.py`. Suites are asked in the order " +
             ", ".join(SUITES) + ", then tests; the first that fails is named.", "",
             "| fault | file | noticed by | failing cases | the first |", "|---|---|---|---:|---|"]
    for m in mutations:
        if r := results.get(identity(m)):
            first = r["first"].replace("|", "\\|")
            lines.append(f"| {m['name'].replace('_', ' ')} | {m['file']} | {r['noticed_by'] or '**nobody**'} | {r['cases']} | {first} |")
    return "\n".join(lines) + "\n"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="mutations whose name holds this word")
    parser.add_argument("--again", action="store_true", help="forget kept results")
    parser.add_argument("--out", default="experiments/verify/results/mutations.md")
    return parser.parse_args()


def check_unmutated():
    """A suite that fails before any mutation would notice everything."""
    error = build(["amrtex"])
    if error:
        raise SystemExit(error)
    for suite in SUITES:
        if failed := failing_cases(suite):
            raise SystemExit(f"verify --suite {suite} fails without a mutation: {failed[0]}")


def main():
    a = arguments()
    mutations = json.loads((ROOT / "tests/mutations/mutations.json").read_text(encoding="utf-8"))
    kept = WORK / "results.json"
    results = json.loads(kept.read_text()) if kept.exists() and not a.again else {}
    refresh_copy()
    open_mutations = [m for m in mutations if a.only in m["name"] and identity(m) not in results]
    if open_mutations:
        check_unmutated()
    for m in open_mutations:
        results[identity(m)] = result = try_mutation(m)
        kept.write_text(json.dumps(results, indent=1))
        print(f"{m['name']}: {result['noticed_by'] or 'nobody'} ({result['cases']})", flush=True)
    (ROOT / a.out).write_text(table(mutations, results), encoding="utf-8")
    unnoticed = [m["name"] for m in mutations if results.get(identity(m), {"noticed_by": ""})["noticed_by"] is None]
    if unnoticed:
        print(f"not noticed: {', '.join(unnoticed)}", file=sys.stderr)
    return 1 if unnoticed else 0


if __name__ == "__main__":
    sys.exit(main())
