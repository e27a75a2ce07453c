#!/usr/bin/env python3
"""What the integrator `tolerance` takes beside the cheapest fixed step that keeps the same promise, on twelve scenes that hide light.

usage: scripts/measure_tolerance.py PROGRAM [--out out/tolerance_scenes] [--results experiments/tolerance/results/scenes]

PROGRAM is the built amrtex; the Python module lies beside it. Each scene (those of tests/tolerance_test.cpp) is drawn with `tolerance` and, for
the integrators of fixed steps that are no controls, with steps from 16 cells down to 1/32, a factor of sqrt 2 apart. The promise: of the pixels that are not empty
in the picture or in its reference, 99 % (10^-2, 10^-3) or 95 % (10^-4) are within the tolerance. A setting's error is that of its stored
picture. What was measured is kept, so that a run that was interrupted goes on.
"""

import argparse
import gzip
import json
import math
import pathlib
import statistics
import subprocess
import sys

import numpy

import experiment_runs

ASKED = {1e-2: 0.99, 1e-3: 0.99, 1e-4: 0.95}
STEPS = [16 * 2 ** (-k / 2) for k in range(19)]
INTEGRATORS = ["exponential_midpoint", "preintegrated"]  # the others are controls
WORST = 1.4  # time of `tolerance` beside the cheapest fixed step, in any scene
MEAN = {1e-2: 1.1, 1e-3: 0.9, 1e-4: 0.9}
VIEW = {"eye": [2.3, 1.9, 2.1], "at": [0.5, 0.5, 0.5], "fov_y": 35}


def waves(x, y, z):
    return 0.5 + 0.3 * numpy.sin(7 * x + 1) * numpy.cos(5 * y) + 0.2 * z * numpy.sin(11 * x + 3 * z)


def noise(x, y, z):
    return numpy.random.default_rng(7).random(numpy.broadcast_shapes(x.shape, y.shape, z.shape))


def patch_values(function, box, cells):
    """f at the centres of a box of cells, [i, j, k] along x, y, z; `cells`: of the whole level along each axis."""
    axes = [(numpy.arange(low, high) + 0.5) / n for low, high, n in zip(*box, cells)]
    return numpy.ascontiguousarray(function(*numpy.meshgrid(*axes, indexing="ij")))


def mesh_of(amrtex, function, root, patches):
    """`patches`: (level, box) with ratio 2 between levels; level 0 is one patch."""
    patches = [(0, ((0, 0, 0), root))] + patches
    values = [patch_values(function, box, [n << level for n in root]) for level, box in patches]
    return amrtex.hierarchy(levels=[level for level, _ in patches], boxes=[box for _, box in patches], values=values, root_cells=root,
                            lower=(0, 0, 0), upper=(1, 1, 1))


def nested(amrtex, function):
    return mesh_of(amrtex, function, (8, 7, 8), [(1, ((4, 6, 4), (10, 10, 12))), (2, ((8, 12, 12), (16, 16, 20)))])


def deep(amrtex, function):
    corners = [(1, ((2,) * 3, (6,) * 3))] + [(level, ((1 << level,) * 3, ((1 << level) + 4,) * 3)) for level in (2, 3, 4)]
    return mesh_of(amrtex, function, (4, 4, 4), corners)


def light(*extinction, scale="linear"):
    first, last = extinction[0][0], extinction[-1][0]
    middle = math.sqrt(first * last) if scale == "log" else (first + last) / 2
    return {"extinction": [list(p) for p in extinction], "scale": scale,
            "color": [[first, 0, 0, 0.3], [middle, 0.9, 0.9, 0.1], [last, 0.8, 0, 0]]}


def scenes(amrtex):
    """name -> mesh, transfer function, view."""
    distance = lambda x, y, z, at: numpy.sqrt((x - at) ** 2 + (y - at) ** 2 + (z - at) ** 2)
    blob = lambda x, y, z: numpy.exp(-8 * ((x - 0.45) ** 2 + (y - 0.55) ** 2 + (z - 0.5) ** 2))
    hot = lambda x, y, z: numpy.where((abs(x - 0.5) < 0.1) & (abs(y - 0.7) < 0.1) & (abs(z - 0.3) < 0.1), 0.95, 0.05)
    hole = lambda x, y, z: numpy.where(noise(x, y, z) < 0.1, numpy.nan, noise(x, y, z))
    decades = lambda x, y, z: 10 ** (-30 + 60 * waves(x, y, z))
    spike = lambda x, y, z: 0.02 / (0.02 + distance(x, y, z, 0.28))
    peaks = light((0.4, 0), (0.7, 30), (0.75, 3), (1, 60))
    waving = nested(amrtex, waves)
    return {
        "smooth": (nested(amrtex, blob), light((0.05, 0), (1, 12)), VIEW),
        "ramp": (waving, light((0, 0), (0.05, 0), (0.3, 2), (0.8, 10), (1.4, 40)), VIEW),
        "narrow peak": (waving, light((0.57, 0), (0.6, 120), (0.63, 0)), VIEW),
        "peak of a thousandth": (waving, light((0.5495, 0), (0.55, 3000), (0.5505, 0)), VIEW),
        "hot cell": (mesh_of(amrtex, hot, (5, 5, 5), []), light((0.1, 0), (0.5, 10), (0.9, 40)), VIEW),
        "random": (nested(amrtex, noise), peaks, VIEW),
        "random with NaN": (nested(amrtex, hole), peaks, VIEW),
        "opaque": (waving, light((0.2, 0), (0.6, 300), (1, 2000)), VIEW),
        "stiff": (waving, light((0.1, 0), (0.5, 1e3), (0.9, 1e6)), VIEW),
        "log": (nested(amrtex, decades), light((1e-30, 0), (1, 5), (1e20, 40), (1e30, 10), scale="log"), VIEW),
        "deep mesh": (deep(amrtex, spike), light((0.05, 0), (0.2, 4), (0.9, 200)), {**VIEW, "at": [0.28] * 3, "fov_y": 12}),
        "shell": (nested(amrtex, lambda x, y, z: distance(x, y, z, 0.5)), light((0.38, 0), (0.4, 60), (0.42, 0)), VIEW),
    }


def experiment(name, file, transfer_function, view, pixels):
    size = {"width": pixels, "height": pixels}
    return {
        "name": name,
        "datasets": {"name": name, "file": str(file)},
        "encodings": [{"name": "page_table", "page_size": 8, "filters": "linear_page"}, {"name": "kd_tree", "filters": "linear_vertex"}],
        "filtering": "manual",
        "render": [{"integrator": "tolerance", "tolerance": list(ASKED), **size}, {"integrator": INTEGRATORS, "step": STEPS, **size}],
        "views": view, "transfer_function": transfer_function, "frames": 7, "warm_up": 2,
        "check": {"psnr_db": 0, "why": "long steps miss peaks: how far is what is measured"},
        "reference": {"filter": "own"},
    }


def measure(program, folder, pixels):
    """Each scene in a folder of its own: name -> folder."""
    sys.path.insert(0, str(program.parent / "python"))
    import amrtex
    found = {}
    for name, (mesh, transfer_function, view) in scenes(amrtex).items():
        place = folder / name.replace(" ", "_")
        place.mkdir(parents=True, exist_ok=True)
        if not (place / "mesh.npz").exists():
            mesh.save(str(place / "mesh.npz"))
        (place / "experiment.json").write_text(json.dumps(experiment(name, place.resolve() / "mesh.npz", transfer_function, view, pixels)))
        done = subprocess.run([program, "run", place / "experiment.json", "--out", place / "out"], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise SystemExit(f"{program} run {place / 'experiment.json'}: exit {done.returncode}\n{done.stdout}{done.stderr}")
        print(f"{name}: {done.stdout.splitlines()[-1] if done.stdout else ''}", file=sys.stderr)
        found[name] = place / "out"
    return found


def seen_errors(file):
    """Of the pixels that are not empty in the picture or in its reference: the largest error of a channel, ascending."""
    with numpy.load(file) as z:
        scale, offset = z["picture_scale"]
        picture = offset + scale * z["picture"].astype(float)
        difference = z["difference_scale"][0] * z["difference"].astype(float)
    # stored in halves of the picture's range: what is empty comes back as less than a quantum of it
    empty = abs(scale) * 2.0**-11
    seen = (picture[..., 3] > empty) | (abs(difference[..., 3]) > 0)
    return numpy.sort(abs(difference).max(axis=-1)[seen])


def share_within(errors, bound):
    return numpy.searchsorted(errors, bound, side="right") / len(errors) if len(errors) else math.nan


def rows_of(name, folder):
    for record in experiment_runs.read_records(folder):
        if record["status"] != "ok":
            continue
        render = record["render"]
        errors = seen_errors(folder / "pictures" / f"{record['configuration']}.npz")
        yield {"scene": name, "encoding": record["encoding"], "integrator": render["integrator"],
               "asked": render["tolerance"] if render["integrator"] == "tolerance" else None, "step": render["step"],
               "ms": record["frame"]["wall_ms"]["median"], "samples": record["work"]["samples"],
               **{f"within_{bound:g}": share_within(errors, bound) for bound in ASKED}}


def compared(rows):
    """(scene, encoding, tolerance) -> what `tolerance` took, and the cheapest fixed step that keeps the promise."""
    groups = {}
    for row in rows:
        groups.setdefault((row["scene"], row["encoding"]), []).append(row)
    for (scene, encoding), group in groups.items():
        for bound, share in ASKED.items():
            ours = next(r for r in group if r["asked"] == bound)
            good = [r for r in group if r["asked"] is None and r[f"within_{bound:g}"] >= share]
            yield scene, encoding, bound, ours, min(good, key=lambda r: r["ms"]) if good else None


def step_text(step):
    return f"{step:.3g}" if step >= 1 else f"1/{1 / step:.3g}"


def table(rows, conditions, pixels):
    lines = ["# `tolerance` beside the cheapest fixed step", "",
             f"Made by `scripts/measure_tolerance.py`: twelve scenes, {pixels} x {pixels}, filters in the shader, {conditions}. Steps in cells, from "
             f"{STEPS[0]:g} to {step_text(STEPS[-1])}, a factor of the square root of 2 apart; integrators {', '.join(INTEGRATORS)}. The promise: "
             + ", ".join(f"{100 * share:g} % of the seen pixels within {bound:g}" for bound, share in ASKED.items()) + ".", "",
             "| scene | encoding | asked | within | ms | cheapest fixed step that keeps the promise | its ms | ratio |",
             "|---|---|---:|---:|---:|---|---:|---:|"]
    ratios = {}
    for scene, encoding, bound, ours, best in compared(rows):
        ratio = ours["ms"] / best["ms"] if best else None
        kept = ours[f"within_{bound:g}"] >= ASKED[bound]
        if best and kept:
            ratios.setdefault((encoding, bound), []).append(ratio)
        lines.append(f"| {scene} | `{encoding}` | {bound:g} | {100 * ours[f'within_{bound:g}']:.1f} %{'' if kept else ' (broken)'} | {ours['ms']:.1f} | "
                     + (f"{best['integrator']}, {step_text(best['step'])} | {best['ms']:.1f} | {ratio:.2f} |" if best else "none | | |"))
    lines += ["", "| encoding | asked | scenes that a fixed step reaches | geometric mean | goal | largest | goal |", "|---|---:|---:|---:|---:|---:|---:|"]
    for (encoding, bound), list_ in ratios.items():
        lines.append(f"| `{encoding}` | {bound:g} | {len(list_)} | {statistics.geometric_mean(list_):.2f} | {MEAN[bound]} | {max(list_):.2f} | {WORST} |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--out", default="out/tolerance_scenes", type=pathlib.Path)
    parser.add_argument("--results", default=experiment_runs.ROOT / "experiments/tolerance/results/scenes", type=pathlib.Path)
    parser.add_argument("--pixels", type=int, default=192)
    a = parser.parse_args()
    a.program = a.program.resolve()
    folders = measure(a.program, a.out, a.pixels)
    rows = [row for name, folder in folders.items() for row in rows_of(name, folder)]
    first = experiment_runs.read_records(next(iter(folders.values())))[0]
    text = table(rows, experiment_runs.conditions(first), a.pixels)
    a.results.mkdir(parents=True, exist_ok=True)
    (a.results / "table.md").write_text(text)
    with gzip.GzipFile(a.results / "settings.csv.gz", "wb", 9, mtime=0) as packed:
        lines = [list(rows[0])] + [["" if v is None else v for v in row.values()] for row in rows]
        packed.write("".join(",".join(map(str, line)) + "\n" for line in lines).encode())
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
