"""What `amrtex report` writes: the page in headless Chromium, the tables in LaTeX, plots, a gallery, and bad input.

  report_page_test.py PROGRAM SUITE     SUITE: Files, Latex, Page, Large, Gallery or Project
"""
import csv
import io
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
import xml.etree.ElementTree as ElementTree
import zlib

import browser

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = sys.argv[1]
SUITE = sys.argv[2]
SCREENSHOTS = os.environ.get("AMRTEX_SCREENSHOTS")  # a folder; without it none are kept
HOSTILE = "</script><script>alert(1)</script> \"quoted\" 'single' a_b 50% $x$ #1 {y} \\z & [w] ~ ^ | 中"
VIEW = {"eye": [2.2, 1.8, 1.5], "at": [0.5, 0.5, 0.5], "up": [0.0, 0.0, 1.0], "fov_y": 35.0}
CURVE = {"extinction": [[0.0, 0.0], [1.0, 20.0]], "color": [[0.0, 0.0, 0.0, 0.5], [1.0, 1.0, 0.5, 0.0]], "scale": "linear"}


def error(decibels):
    """No error at all where there are no decibels."""
    rmse = 0.0 if decibels is None else 10 ** (-decibels / 20)
    return {"rmse": rmse, "max": 4 * rmse, "psnr_db": decibels, "mrse": rmse, "reference": "0f" * 16, "split": None,
            "reference_error": None, "limited_by_reference": None, "within_tolerance_seen": None}


def timing(ms):
    return {"median": ms, "mad": ms / 20, "ci95": [ms * 0.9, ms * 1.1], "min": ms * 0.9, "n": 3, "coverage": 0.75}


def record(number, encoding="uniform", ms=2.0, payload=1 << 20, decibels=45.0, **changes):
    """A measured point of schema 2; `number` makes its configuration."""
    made = {
        "schema": "amrtex-record/2", "status": "ok", "reason": None, "experiment": "sizes", "configuration": f"{number:032x}",
        "implementation": "ab" * 16, "repetition": 0,
        "asked": {"name": "sizes", "datasets": {"name": "blobs", "file": "data/blobs"}, "encodings": {"name": encoding},
                  "views": VIEW, "transfer_function": CURVE},
        "dataset": {"name": "blobs", "source": "data/blobs", "hash": "11" * 16, "exact_hash": "22" * 16, "leaf_cells": 4096,
                    "stored_cells": 4608, "levels": 3, "patches": 9, "field": "phi"},
        "encoding": encoding, "build_parameters": {}, "filter": "linear_vertex", "storage": "r32f", "filtering": "hardware",
        "render": {"consumer": "raycast", "mode": "dvr", "sampling": "adaptive", "step": 1.0, "integrator": "exponential_midpoint",
                   "width": 64, "height": 64, "view": VIEW, "view_name": "corner", "transfer_function": CURVE,
                   "transfer_function_name": "ramp"},
        "memory": {"total_bytes": payload + 4096, "by_role": {"payload": payload, "duplicated": 2048, "topology": 1024, "padding": 1024},
                   "texels_by_texture": {"tex_values": payload // 4}, "texels_per_cell": 1.25, "host_peak_bytes": payload},
        "build_seconds": 0.125, "upload_seconds": 0.01, "process_peak_bytes": 1 << 30, "first_frame_ms": 30.0,
        "frame": {"wall_ms": timing(ms), "gpu_ms": None, "all_wall_ms": [ms * 0.9, ms, ms * 1.1], "warm_up": 1},
        "work": {"rays": 4096, "samples": 100000 + number, "regions": 700, "regions_skipped": 5},
        "check": {"psnr_db": 30.0, "from": "default", "why": None}, "check_reason": None,
        "error": error(decibels), "error_common": {**error(decibels), "filter": "linear_vertex"},
        "left_out": [{"what": "LOD texture", "why": "no level of detail is asked for", "bytes": 512, "seconds": None}],
        "statistics": {}, "storage_scale": {"a": 0.0, "b": 1.0}, "image_hash": f"{number:032x}",
        "context": {"renderer": "llvmpipe", "device": "a processor", "gl_version": "4.5", "extensions_missing": [], "cpu": "a processor",
                    "cores": 2, "environment": {}, "build_type": "Release", "compiler": "GCC", "commit": "c0ffee", "dirty": False,
                    "shader_hash": "33" * 16, "shader_cache": "warm", "date": "2026-01-02T03:04:05Z", "software": True, "warnings": []}}
    made.update(changes)
    return made


def unmeasured(number, status, reason, **changes):
    made = record(number, **changes)
    made.update(status=status, reason=reason)
    for key in ("memory", "build_seconds", "upload_seconds", "frame", "work", "error", "error_common", "check", "left_out"):
        made[key] = None
    return made


def write_records(folder, records):
    """As `run` writes them: one line a record, with its checksum."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    lines = []
    for one in records:
        text = json.dumps(one, separators=(",", ":"), ensure_ascii=False)
        lines.append(f'{{"record": {text}, "crc32": "{zlib.crc32(text.encode()):08x}"}}\n')
    (folder / "records.jsonl").write_text("".join(lines), encoding="utf-8")
    return folder


def sweep():
    """Encodings whose front is known: a is the smallest, b the fastest at 40 dB, c at 50 and 60 dB; d is beaten in all."""
    return [record(1, "kd_tree", ms=9.0, payload=1 << 18, decibels=35.0),
            record(2, "page_table", ms=2.0, payload=1 << 20, decibels=44.0, build_parameters={"page_size": 8}),
            record(3, "page_table", ms=3.0, payload=1 << 19, decibels=41.0, build_parameters={"page_size": 16}),
            record(4, "page_table", ms=4.0, payload=3 << 18, decibels=41.5, build_parameters={"page_size": 32}),
            record(5, "uniform", ms=5.0, payload=1 << 22, decibels=65.0),
            record(6, "exabricks", ms=50.0, payload=1 << 23, decibels=20.0, filter="basis"),
            record(7, "octree", ms=80.0, payload=1 << 24, decibels=None),
            unmeasured(8, "unsupported", "octree has no filter <basis> & 50% of nothing_at_all", encoding="octree", filter="basis")]


def report(*arguments):
    return subprocess.run([PROGRAM, "report", *map(str, arguments)], capture_output=True, text=True)


def page_data(path):
    text = pathlib.Path(path).read_text(encoding="utf-8")
    return json.loads(re.search(r'<script type="application/json" id="page-data">(.*?)</script>', text, re.DOTALL)[1])


def write_picture(folder, configuration, values, difference=None):
    """A point's stored picture: rows of rows of four channels."""
    import zipfile

    def half_array(rows):
        height, width = len(rows), len(rows[0])
        flat = b"".join(struct.pack("<4e", *pixel) for row in rows for pixel in row)
        return npy("<f2", (height, width, 4), flat)

    import struct

    def npy(kind, shape, data):
        text = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".encode()
        text += b" " * (63 - (10 + len(text)) % 64) + b"\n"
        return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + data

    pictures = pathlib.Path(folder) / "pictures"
    pictures.mkdir(exist_ok=True)
    with zipfile.ZipFile(pictures / f"{configuration}.npz", "w") as file:
        file.writestr("picture.npy", half_array(values))
        file.writestr("picture_scale.npy", npy("<f8", (2,), struct.pack("<2d", 1.0, 0.0)))
        if difference is not None:
            file.writestr("difference.npy", half_array(difference))
            file.writestr("difference_scale.npy", npy("<f8", (2,), struct.pack("<2d", 0.5, 0.0)))


def gradient(edge, shift=0.0):
    return [[[x / edge, y / edge, shift, 1.0] for x in range(edge)] for y in range(edge)]


def flat(edge, value):
    return [[[value, 0.0, -value, 0.0]] * edge for _ in range(edge)]


class Temporary(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="amrtex_report_"))

    def tearDown(self):
        shutil.rmtree(self.folder)

    def made(self, records, *arguments):
        """A folder of these records, reported."""
        folder = write_records(self.folder / "out", records)
        ended = report(folder, *arguments)
        self.assertEqual(ended.returncode, 0, ended.stderr)
        self.said = ended
        return folder


class Files(Temporary):
    def test_the_verdict_names_the_smallest_and_the_fastest_with_what_they_cost(self):
        data = page_data(self.made(sweep()) / "report.html")
        self.assertEqual(len(data["scenes"]), 1)
        scene = data["scenes"][0]
        self.assertRegex(scene["smallest"], r"^The smallest is kd_tree, linear_vertex: 0\.2539 MiB, 9 ms, 35\.0 dB\.$")
        self.assertRegex(scene["fastest"], r"^The fastest is at 40 dB page_table \(page_size 8\), linear_vertex \(1\.004 MiB, 2 ms, 44\.0 dB\); "
                                           r"at 50 dB and 60 dB uniform, linear_vertex \(4\.004 MiB, 5 ms, 65\.0 dB\)\.$")
        self.assertEqual([a["asked"] for a in scene["answers"]], ["smallest", "40 dB", "50 dB", "60 dB"])

    def test_fronts_hold_what_nothing_beats_and_intervals(self):
        scene = page_data(self.made(sweep()) / "report.html")["scenes"][0]
        time_front = next(p for p in scene["plots"] if p["kind"] == "front_time")
        line = next(layer for layer in time_front["spec"]["layer"] if layer["mark"].get("interpolate") == "step-after")
        self.assertEqual([v["x"] for v in line["data"]["values"]], [2, 5, 80])
        marks = next(layer for layer in time_front["spec"]["layer"] if layer.get("name") == "marks")["data"]["values"]
        self.assertEqual(len(marks), 7)
        self.assertEqual((marks[0]["low"], marks[0]["high"]), (round(marks[0]["x"] * 0.9, 6), round(marks[0]["x"] * 1.1, 6)))
        self.assertIn("1 exact, drawn below the others", time_front["note"])

    def test_there_is_a_curve_over_page_sizes_and_bars_that_add_up(self):
        scene = page_data(self.made(sweep()) / "report.html")["scenes"][0]
        plots = {p["kind"]: p for p in scene["plots"]}
        curve = next(layer for layer in plots["parameter_bytes"]["spec"]["layer"] if layer["mark"]["type"] == "line")
        self.assertEqual([v["x"] for v in curve["data"]["values"]], [8, 16, 32])
        bars = plots["memory"]["spec"]["layer"][0]["data"]["values"]
        ends = {}
        for bar in bars:
            ends[bar["y"]] = max(ends.get(bar["y"], 0), bar["to"])
        for end, bytes_of_one in zip(sorted(ends.values()), sorted(r["memory"]["total_bytes"] for r in sweep() if r["memory"])):
            self.assertAlmostEqual(end / (bytes_of_one / 2**20), 1, places=4)

    def test_exponents_of_cost_against_mesh_size_are_those_of_a_power_law(self):
        def sized(number, cells):
            made = record(number, ms=cells ** 0.5 / 100, payload=16 * cells)
            made["dataset"] = {**made["dataset"], "name": f"mesh {cells}", "hash": f"{cells:032x}", "leaf_cells": cells}
            made["build_seconds"] = 1e-6 * cells
            return made
        folder = self.made([sized(i, 4 ** (5 + i)) for i in range(4)])
        text = (folder / "report.html").read_text()
        number = r"<td class=\"number\">[^<]*</td>"  # meshes, and the leaf cells of the smallest and the largest
        rows = re.findall(r"<td>(build|bytes|frame)</td>" + 3 * number + r"<td class=\"number\">([\d.]+)", text)
        exponents = {name: float(value) for name, value in rows}
        self.assertAlmostEqual(exponents["build"], 1.0, places=3)
        self.assertAlmostEqual(exponents["frame"], 0.5, places=3)
        self.assertTrue((folder / "plots/mesh_size_build.svg").exists())

    def test_causes_of_errors_are_plotted(self):
        split = {cause: {"rmse": value, "max": value} for cause, value in (("step", 0.01), ("encoding", 0.002), ("storage", 0.0))}
        explained = record(1)
        explained["error"]["split"] = {**split, "sum_closes": 1e-9, "early_end": None}
        data = page_data(self.made([explained, record(2, "kd_tree")]) / "report.html")
        plot = next(p for p in data["scenes"][0]["plots"] if p["kind"] == "causes")
        self.assertEqual([(v["color"], v["x"]) for v in plot["spec"]["layer"][0]["data"]["values"]], [("step", 0.01), ("encoding", 0.002)])

    def test_every_plot_is_an_svg_file(self):
        folder = self.made(sweep())
        plots = sorted((folder / "plots").glob("*.svg"))
        self.assertGreaterEqual(len(plots), 4)
        for plot in plots:
            root = ElementTree.fromstring(plot.read_text(encoding="utf-8"))
            self.assertEqual(root.tag, "{http://www.w3.org/2000/svg}svg")
            self.assertNotIn("nan", plot.read_text(encoding="utf-8"))

    def test_a_record_is_whole_on_the_page_and_says_how_to_measure_it_again(self):
        records = sweep()
        data = page_data(self.made(records) / "report.html")

        def whole(value):
            if isinstance(value, list):
                return [whole(v) for v in value]
            if not isinstance(value, dict):
                return value
            return whole(data["shared"]["parts"][value["\x01"]]) if "\x01" in value else {k: whole(v) for k, v in value.items()}
        found = {r["configuration"]: r for r in map(whole, data["shared"]["records"])}
        for one in records:
            self.assertEqual(found[one["configuration"]], one)
        self.assertEqual(sum(c is not None and "amrtex run --from-record" in c for c in data["commands"]), len(records))

    def test_hostile_names_are_only_names(self):
        nasty = record(1, experiment=HOSTILE)
        nasty["dataset"] = {**nasty["dataset"], "name": HOSTILE, "field": HOSTILE}
        nasty["render"] = {**nasty["render"], "view_name": HOSTILE, "transfer_function_name": HOSTILE}
        nasty["build_parameters"] = {HOSTILE: 3, "a/b~c": 4}
        nasty["left_out"] = [{"what": HOSTILE, "why": HOSTILE, "bytes": 1, "seconds": None}]
        other = record(2, "kd_tree", experiment=HOSTILE, build_parameters={HOSTILE: 5, "a/b~c": 5})
        third = record(3, "kd_tree", experiment=HOSTILE, build_parameters={HOSTILE: 7, "a/b~c": 6})
        folder = self.made([nasty, other, third, unmeasured(4, "failed", HOSTILE, experiment=HOSTILE)])
        text = (folder / "report.html").read_text(encoding="utf-8")
        self.assertNotIn("<script>alert", text)
        self.assertEqual(page_data(folder / "report.html")["title"], HOSTILE)
        for plot in (folder / "plots").glob("*.svg"):
            ElementTree.fromstring(plot.read_text(encoding="utf-8"))
        rows = list(csv.reader(io.StringIO((folder / "table.csv").read_text(encoding="utf-8"))))
        self.assertTrue(any(HOSTILE in cell for row in rows for cell in row))
        self.assertEqual(len({len(row) for row in rows if row}), 1)

    def test_the_absent_is_a_dash_in_every_column(self):
        empty = record(1)
        for key, value in list(empty.items()):
            if key not in ("schema", "status", "configuration", "context", "check", "check_reason"):
                empty[key] = None
        empty["check"], empty["check_reason"] = None, "nothing is known"
        data = page_data(self.made([empty, record(2, "kd_tree")]) / "report.html")
        self.assertEqual(len(data["table"]["rows"]), 2)
        self.assertTrue(any(all(c is None or c == "" or isinstance(c, str) for c in row) for row in data["table"]["rows"]))

    def test_records_of_both_schemas_stand_on_one_page(self):
        old = record(1)
        old["schema"] = "amrtex-record/1"
        for key in ("configuration", "implementation", "repetition", "asked", "process_peak_bytes", "check", "check_reason"):
            del old[key]
        for key in ("source", "exact_hash"):
            del old["dataset"][key]
        for part in (old["error"], old["error_common"]):
            for key in ("reference_error", "limited_by_reference", "within_tolerance_seen"):
                del part[key]
        for key in ("device", "shader_cache"):
            del old["context"][key]
        folder = self.folder / "old"
        (folder / "records").mkdir(parents=True)
        (folder / "records/a.json").write_text(json.dumps(old))
        (folder / "records/b.json").write_text(json.dumps(record(2, "kd_tree")))
        ended = report(folder)
        self.assertEqual(ended.returncode, 0, ended.stderr)
        data = page_data(folder / "report.html")
        self.assertEqual(len(data["labels"]), 2)
        self.assertEqual(sum(command is None for command in data["commands"]), 1)

    def test_no_records_is_one_clear_error(self):
        ended = report(self.folder)
        self.assertEqual(ended.returncode, 1)
        self.assertEqual(len(ended.stderr.strip().splitlines()), 1)
        self.assertIn("no records", ended.stderr)
        write_records(self.folder / "empty", [])
        ended = report(self.folder / "empty")
        self.assertEqual(ended.returncode, 1)
        self.assertIn("no records", ended.stderr)
        self.assertFalse((self.folder / "empty/report.html").exists())

    def test_a_point_without_a_picture_or_with_a_damaged_one_is_a_warning(self):
        folder = write_records(self.folder / "out", sweep())
        write_picture(folder, f"{2:032x}", gradient(8), flat(8, 0.25))
        (folder / "pictures" / f"{1:032x}.npz").write_bytes(b"PK no zip")
        ended = report(folder)
        self.assertEqual(ended.returncode, 0, ended.stderr)
        self.assertIn("warning", ended.stderr)
        data = page_data(folder / "report.html")
        self.assertEqual(len(data["pictures"]), 1)
        self.assertEqual(data["pictures"][0]["scale"], 0.125)
        self.assertEqual(data["pictures"][0]["largest"], 0.125)

    def test_pictures_that_are_kept_serve_the_page_as_well(self):
        folder = write_records(self.folder / "out", sweep())
        for number in (1, 2, 5):
            write_picture(folder, f"{number:032x}", gradient(200, number / 8), flat(200, 0.01 * number))
        self.assertEqual(report(folder, "--keep-pictures").returncode, 0)
        self.assertLess((folder / "pictures.npz").stat().st_size, 2_000_000)
        full = page_data(folder / "report.html")
        self.assertEqual(full["pictures"][0]["width"], 200)
        shutil.rmtree(folder / "pictures")
        self.assertEqual(report(folder).returncode, 0)
        small = page_data(folder / "report.html")
        self.assertEqual([p["point"] for p in small["pictures"]], [p["point"] for p in full["pictures"]])
        self.assertEqual(small["pictures"][0]["width"], 100)

    def test_a_picked_point_that_is_not_there_is_an_error(self):
        folder = write_records(self.folder / "out", sweep())
        ended = report(folder, "--picture", "beef")
        self.assertEqual(ended.returncode, 2)
        self.assertIn("beef", ended.stderr)


class Latex(Temporary):
    def test_tables_compile_whatever_names_say(self):
        nasty = record(1, experiment=HOSTILE)
        nasty["dataset"] = {**nasty["dataset"], "name": HOSTILE}
        other = record(2, "kd_tree", experiment=HOSTILE)
        folder = self.made([nasty, other, unmeasured(3, "failed", HOSTILE + " é × ± ≤", experiment=HOSTILE)])
        (folder / "all.tex").write_text("\\documentclass{article}\n\\usepackage{booktabs,graphicx}\n\\begin{document}\n"
                                        "\\input{table}\n\\end{document}\n")
        ended = subprocess.run(["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "all.tex"], cwd=folder,
                               capture_output=True, text=True, errors="replace")
        self.assertEqual(ended.returncode, 0, ended.stdout[-3000:])
        self.assertIn("\\toprule", (folder / "table.tex").read_text())


class Chromium(Temporary):
    def opened(self, path, **how):
        page = self.tabs.page(**how)
        self.seconds = page.open(path)
        return page

    def setUp(self):
        super().setUp()
        self.tabs = browser.Browser()

    def tearDown(self):
        self.tabs.close()
        super().tearDown()

    def pictured(self):
        folder = write_records(self.folder / "out", sweep())
        for one in sweep()[:7]:
            number = int(one["configuration"], 16)
            write_picture(folder, one["configuration"], gradient(64, number / 8), flat(64, 0.01 * number))
        ended = report(folder)
        self.assertEqual(ended.returncode, 0, ended.stderr)
        return folder / "report.html"

    def keep(self, page, name):
        if SCREENSHOTS:
            page.screenshot(pathlib.Path(SCREENSHOTS) / f"{name}.png")

    def draw_all(self, page):
        """Plots are drawn when they come into sight."""
        boxes = "document.querySelectorAll('section:not([hidden]) .vega')"
        for i in range(page.evaluate(f"{boxes}.length")):
            page.evaluate(f"{boxes}[{i}].scrollIntoView({{block: 'center', behavior: 'instant'}})")
            page.wait(f"{boxes}[{i}].querySelector('svg')")

    def rows(self, page):
        return page.evaluate("[...document.querySelectorAll('#table tbody tr')].map(r => Number(r.dataset.point))")


class Page(Chromium):
    def test_the_console_is_silent_and_nothing_is_asked_for(self):
        path = self.pictured()
        for how in ({}, {"width": 400}, {"dark": True}):
            page = self.opened(path, **how)
            self.draw_all(page)
            self.assertEqual(page.complaints(), [])
            self.assertEqual([url for url in page.requests() if not url.endswith("report.html")], [])

    def test_nothing_is_wider_than_a_telephone(self):
        page = self.opened(self.pictured(), width=400, height=800)
        page.evaluate("scrollTo(0, document.body.scrollHeight)")
        page.settle()
        self.assertLessEqual(page.evaluate("document.documentElement.scrollWidth"), 400)
        self.keep(page, "narrow")

    def test_numbers_are_those_of_the_records(self):
        path = self.pictured()
        page, data = self.opened(path), page_data(path)
        columns = page.evaluate("[...document.querySelectorAll('#table thead button')].map(b => b.dataset.column)")
        shown = page.evaluate("[...document.querySelectorAll('#table tbody tr')].map(r => [...r.cells].map(c => c.textContent))")
        self.assertEqual(len(shown), 8)
        by_samples = {100000 + int(r["configuration"], 16): r for r in sweep()}
        for cells in shown:
            row = dict(zip(columns, cells))
            if row["status"] != "ok":
                continue
            one = by_samples[int(row["samples"])]
            self.assertTrue(row["encoding"].startswith(one["encoding"]))
            self.assertAlmostEqual(float(row["total"]), one["memory"]["total_bytes"] / 2**20, delta=1e-3 * float(row["total"]))
            self.assertAlmostEqual(float(row["wall"].split(" ± ")[0]), one["frame"]["wall_ms"]["median"], places=6)
            decibels = one["error_common"]["psnr_db"]
            self.assertEqual(row["psnr_common"], "–" if decibels is None else f"{decibels:g}")
        self.assertEqual(page.evaluate("document.getElementById('verdict').textContent"),
                         f"{data['scenes'][0]['smallest']} {data['scenes'][0]['fastest']}")

    def test_any_column_sorts_and_filters(self):
        page = self.opened(self.pictured())
        cells = "[...document.querySelectorAll('#table tbody tr')].map(r => r.cells[i].textContent)"
        column = lambda key: page.evaluate(
            f"(() => {{ const i = [...document.querySelectorAll('#table thead button')].findIndex(b => b.dataset.column === '{key}'); return {cells}; }})()")
        page.click("button[data-column=wall]")
        times = [float(t.split()[0]) for t in column("wall") if t != "–"]
        self.assertEqual(times, sorted(times))
        self.assertEqual(column("wall")[-1], "–", "what is not there stands last")
        page.click("button[data-column=wall]")
        times = [float(t.split()[0]) for t in column("wall") if t != "–"]
        self.assertEqual(times, sorted(times, reverse=True))
        self.assertEqual(column("wall")[-1], "–")
        self.assertEqual(page.evaluate("document.querySelector('th[aria-sort]').getAttribute('aria-sort')"), "descending")
        for text, count in ((">4.5", 4), ("2..4", 3), ("<=2", 1), ("=5", 1), ("!<10", 3)):
            page.type("input[data-filter=wall]", text)
            self.assertEqual(len(self.rows(page)), count, text)
        page.type("input[data-filter=wall]", "2..4")
        page.type("input[data-filter=encoding]", "size 16")
        self.assertEqual(column("encoding"), ["page_table (page_size 16)"])
        self.assertEqual(page.evaluate("document.getElementById('count').textContent"), "1 of 8 points")
        page.click("#clear")
        page.type("#search", "kd_tree")
        self.assertEqual(len(self.rows(page)), 1)
        self.assertEqual(page.complaints(), [])

    def test_a_hover_tells_and_a_click_shows_the_whole_record(self):
        path = self.pictured()
        page = self.opened(path)
        page.place("#fronts .vega")
        if not page.evaluate("typeof vegaEmbed === 'function'"):
            self.skipTest("built without the npm packages of scripts/setup.sh: plots are pictures")
        page.wait("document.querySelector('#fronts .mark-symbol.role-mark path')")
        page.settle()
        x, y = page.place("#fronts .mark-symbol.role-mark path")
        page.move(x - 3, y)
        page.move(x, y)
        page.wait("!document.getElementById('tip').hidden")
        told = page.evaluate("document.getElementById('tip').textContent")
        self.assertRegex(told, r"frame wall \(ms\): [\d.]+ ± [\d.]+")
        page.click_at(x, y)
        page.wait("document.getElementById('record').open")
        title = page.evaluate("document.getElementById('record-title').textContent")
        self.assertTrue(told.startswith(title))
        tree = page.evaluate("document.getElementById('record-body').textContent")
        point = int(page.evaluate("document.getElementById('record').dataset.point"))
        data = page_data(path)
        self.assertIn("amrtex run --from-record", tree)
        self.assertIn("implementation", tree)
        self.assertEqual(data["labels"][point], title)
        self.keep(page, "record")
        page.press("Escape")
        page.wait("!document.getElementById('record').open")

    def test_it_works_by_keyboard(self):
        page = self.opened(self.pictured())
        page.place("#table")
        page.evaluate("document.querySelector('#table tbody tr[tabindex=\"0\"]').focus()")
        page.press("ArrowDown")
        page.press("ArrowDown")
        third = self.rows(page)[2]
        self.assertEqual(page.evaluate("Number(document.activeElement.dataset.point)"), third)
        page.press("Enter")
        page.wait("document.getElementById('record').open")
        self.assertEqual(page.evaluate("Number(document.getElementById('record').dataset.point)"), third)
        page.press("Escape")
        page.place("#slider")
        page.evaluate("document.getElementById('slider').focus()")
        page.press("ArrowRight")
        self.assertEqual(page.evaluate("document.getElementById('stage').style.getPropertyValue('--split')"), "51%")

    def test_pictures_stand_side_by_side_with_the_difference_and_its_scale(self):
        path = self.pictured()
        page, data = self.opened(path), page_data(path)
        self.assertEqual(page.evaluate("document.getElementById('thumbnails').children.length"), len(data["pictures"]))
        page.click("#thumbnails button:nth-child(2)")
        second = data["pictures"][1]
        self.assertEqual(page.evaluate("document.getElementById('image-left').src"), data["images"][second["image"]])
        self.assertEqual(page.evaluate("document.getElementById('image-right').src"), data["images"][second["reference"]])
        self.assertEqual(page.evaluate("document.getElementById('scale-high').textContent"), f"+{second['scale']:.4g}")
        number = int(sweep()[0]["configuration"], 16)
        self.assertTrue(any(math.isclose(p["largest"], 0.005 * number, rel_tol=1e-3) for p in data["pictures"]))
        page.wait("document.getElementById('image-left').naturalWidth === 64")
        self.keep(page, "pictures")

    def test_hostile_names_run_nothing(self):
        nasty = record(1, experiment=HOSTILE)
        nasty["dataset"] = {**nasty["dataset"], "name": HOSTILE}
        nasty["render"] = {**nasty["render"], "view_name": HOSTILE}
        folder = self.made([nasty, record(2, "kd_tree", filter=HOSTILE), unmeasured(3, "failed", HOSTILE)])
        page = self.opened(folder / "report.html")
        self.assertIn(HOSTILE, page.evaluate("document.querySelector('h1').textContent"))
        self.assertEqual(page.complaints(), [])

    def test_nothing_to_compare_is_said(self):
        page = self.opened(self.made([unmeasured(1, "failed", "no driver")]) / "report.html")
        self.assertIn("Nothing was drawn", page.evaluate("document.getElementById('verdict').textContent"))
        self.assertEqual(page.complaints(), [])

    def test_it_prints_all_rows_in_black_on_white(self):
        page = self.opened(self.made([record(i) for i in range(1, 400)]) / "report.html", dark=True)
        page.call("Emulation.setEmulatedMedia", media="print")
        page.evaluate("dispatchEvent(new Event('beforeprint'))")
        self.assertEqual(len(self.rows(page)), 399)
        self.assertEqual(page.evaluate("getComputedStyle(document.body).backgroundColor"), "rgb(255, 255, 255)")


class Large(Chromium):
    POINTS = 2000

    def test_two_thousand_points_are_shown_and_filtered_in_two_seconds(self):
        encodings = ("uniform", "page_table", "octree", "kd_tree", "exabricks")
        records = []
        for i in range(self.POINTS):
            made = record(i, encodings[i % 5], ms=round(1 + (i * 37 % 1000) / 10, 3), payload=4096 * (1 + i * 17 % 900),
                          decibels=round(20 + (i * 29 % 600) / 10, 3), build_parameters={"page_size": 2 ** (i % 7)})
            made["render"] = {**made["render"], "step": round(0.125 * (1 + i % 16), 3)}
            made["frame"]["all_wall_ms"] = [round(made["frame"]["wall_ms"]["median"] * (0.9 + 0.02 * k) + i * 1e-5, 6) for k in range(9)]
            made["frame"]["wall_ms"]["n"] = 9
            records.append(made)
        folder = self.made(records)
        size = (folder / "report.html").stat().st_size
        page = self.opened(folder / "report.html")
        begin = time.monotonic()
        page.type("input[data-filter=encoding]", "kd_tree")
        page.click("button[data-column=wall]")
        page.settle()
        filtered = time.monotonic() - begin
        print(f"{self.POINTS} points: {size / 1e6:.2f} MB, shown in {self.seconds:.2f} s, filtered and sorted in {filtered:.2f} s")
        self.assertLessEqual(size, 10_000_000)
        self.assertEqual(page.evaluate("document.getElementById('count').textContent"), f"{self.POINTS // 5} of {self.POINTS} points")
        self.assertLessEqual(self.seconds, 2)
        self.assertLessEqual(filtered, 2)
        self.assertEqual(page.complaints(), [])
        self.keep(page, "large")


class Gallery(Chromium):
    def test_a_site_has_a_page_an_experiment_and_an_index(self):
        experiments = self.folder / "experiments"
        for name in ("first", "second"):
            folder = write_records(experiments / name / "results", sweep())
            (experiments / name / "README.md").write_text(f"# {name}\n\n**Question.** Is `{name}` <b>first</b>?\n\n**Conclusion.** It is.\n")
            write_picture(folder, f"{2:032x}", gradient(64), flat(64, 0.01))
        write_records(experiments / "second" / "results_more", [record(1, experiment="more")])
        (experiments / "empty").mkdir()
        site = self.folder / "site"
        ended = report("--all", experiments, "-o", site)
        self.assertEqual(ended.returncode, 0, ended.stderr)
        self.assertIn("without records: empty", ended.stdout)
        self.assertEqual(sorted(p.name for p in site.iterdir()), ["first.html", "index.html", "scripts.js", "second.html"])
        page = self.opened(site / "second.html")
        self.assertIn("Is second <b>first</b>?", page.evaluate("document.querySelector('.question').textContent"))
        self.assertEqual(page.evaluate("document.querySelectorAll('#scene option').length"), 2)
        self.assertEqual(page.complaints(), [])
        index = self.tabs.page()
        index.open(site / "index.html", ready="document.querySelectorAll('a.entry').length === 2")
        self.assertEqual(index.evaluate("document.querySelectorAll('.entry').length"), 3)
        self.assertEqual(index.complaints(), [])
        self.keep(index, "index")

    def test_bad_use_is_said(self):
        self.assertEqual(report("--all", self.folder / "none", "-o", self.folder / "site").returncode, 1)
        self.assertEqual(report("--all", self.folder).returncode, 2)
        self.assertEqual(report().returncode, 2)


class Project(Chromium):
    def test_the_site_of_all_experiments_is_small_and_every_page_works(self):
        site = self.folder / "site"
        ended = report("--all", ROOT / "experiments", "-o", site)
        self.assertEqual(ended.returncode, 0, ended.stderr)
        size = sum(p.stat().st_size for p in site.iterdir())
        print(f"site of {len(list(site.iterdir()))} files: {size / 1e6:.1f} MB")
        self.assertLessEqual(size, 25_000_000)
        for path in sorted(site.glob("*.html")):
            if path.name == "index.html":
                continue
            with self.subTest(page=path.name):
                page = self.opened(path)
                self.draw_all(page)
                self.assertEqual(page.complaints(), [])


def missing():
    """Why this suite cannot run here."""
    if SUITE == "Latex" and not shutil.which("pdflatex"):
        return "no pdflatex here (Debian: texlive-latex-recommended, texlive-latex-extra)"
    if SUITE in ("Page", "Large", "Gallery", "Project") and not browser.executable():
        return "no Chromium here (Debian: chromium); pages are not opened"
    return None


if __name__ == "__main__":
    if missing():
        print(missing())
        sys.exit(77)
    unittest.main(argv=[sys.argv[0], *(sys.argv[3:] or [SUITE])])
