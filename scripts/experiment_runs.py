"""Runs experiments with a given program and reads their records: what compare_pictures.py and compare_times.py share."""

import json
import os
import pathlib
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent


def read_experiment(path):
    """The experiment of a file, with the files that it names found from any folder."""
    path = ROOT / path
    return _with_whole_paths(json.loads(path.read_text()), path.parent)


def _with_whole_paths(value, folder):
    if isinstance(value, list):
        return [_with_whole_paths(v, folder) for v in value]
    if not isinstance(value, dict):
        return value
    whole = {k: _with_whole_paths(v, folder) for k, v in value.items()}
    if isinstance(whole.get("file"), str):
        whole["file"] = str((folder / whole["file"]).resolve())
    return whole


def read_records(folder):
    """The records of a folder: the last line of each configuration, or, of older programs, a file each."""
    lines = folder / "records.jsonl"
    if not lines.exists():
        return [json.loads(f.read_text()) for f in sorted((folder / "records").glob("*.json"))]
    last = {}
    for line in lines.read_text().splitlines():
        record = json.loads(line)["record"]
        last[record["configuration"], record["repetition"]] = record
    return [last[key] for key in sorted(last)]


def run(program, experiment, environment=None):
    """Runs an experiment in a folder of its own; its records. Ends the script where the program fails."""
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "experiment.json"
        file.write_text(json.dumps(experiment))
        out = pathlib.Path(folder) / "out"
        done = subprocess.run([program, "run", str(file), "--out", str(out)], capture_output=True, text=True,
                              env={**os.environ, **(environment or {})}, check=False)
        if done.returncode != 0:
            raise SystemExit(f"{program} run, experiment {experiment['name']}: exit {done.returncode}\n{done.stdout}{done.stderr}")
        return read_records(out)


def conditions(record):
    """One line: what drew it, on what, by which program, when."""
    c = record["context"]
    return f"{c['renderer']} on {c['cores']} cores of {c['cpu']}, {c['build_type']} of commit {(c['commit'] or 'unknown')[:12]}, {c['date'][:10]}"


# what a record says of the point that was asked for; the rest is what came of it
ASKED = ("dataset.name", "encoding", "build_parameters", "filter", "storage", "filtering", "render")


def setting(record):
    """What a record's point was asked for, as path -> value."""
    flat = {}

    def visit(value, path):
        if isinstance(value, dict):
            for key, inner in value.items():
                visit(inner, f"{path}.{key}" if path else key)
        elif any(path == a or path.startswith(a + ".") for a in ASKED):
            flat[path] = json.dumps(value)

    visit(record, "")
    return flat


def title(record):
    """One line that names a record's point for people."""
    parameters = " ".join(f"{k}={json.dumps(v)}" for k, v in sorted(record["build_parameters"].items()))
    render = record["render"]
    return (f"{record['encoding']} {record['filter']} {record['filtering']} {parameters} "
            f"{render['mode']} {render['sampling']} skip={json.dumps(render['skip'])}").replace('"', "")
