"""The module amrtex against the program, closed forms and every kind of bad input.

  PYTHONPATH=build/<preset>/python python3 -m pytest python/python_test.py
"""
import ast
import contextlib
import io
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import amrtex

ROOT = pathlib.Path(__file__).resolve().parent.parent
TINY = ROOT / "data/amrex_tiny/plt00008"
VIEW = {"eye": [2.2, 1.8, 1.5], "at": [0.5, 0.5, 0.5], "up": [0, 0, 1], "fov_y": 35}


@pytest.fixture(scope="module")
def tiny():
    return amrtex.open(TINY)


def amrtex_program(*arguments, **options):
    return subprocess.run([amrtex.program(), *map(str, arguments)], capture_output=True, text=True, **options)


def two_levels(value=lambda x, y, z: x, **more):
    """The unit cube: 4³ cells, and 4³ cells of half their width over the corner at 1."""
    def cells(lower, width):
        centre = [(np.arange(4) + 0.5) * width + l for l in lower]
        return value(*np.meshgrid(*centre, indexing="ij"))

    return amrtex.hierarchy(levels=[0, 1], boxes=[[(0, 0, 0), (4, 4, 4)], [(4, 4, 4), (8, 8, 8)]],
                            values=[cells((0, 0, 0), 0.25), cells((0.5, 0.5, 0.5), 0.125)], **more)


# meshes


def test_a_data_set_says_what_the_command_line_says(tiny):
    info = json.loads(amrtex_program("info", TINY, "--json", check=True).stdout)
    assert tiny.levels == info["levels"]
    assert tiny.leaf_cells == info["leaf_cells"]
    assert tiny.fields == [f["name"] for f in info["fields"]]
    assert tiny.hash == info["hash"]
    assert tiny.domain.tolist() == [info["domain"]["lower"], info["domain"]["upper"]]
    for field in info["fields"]:
        assert tiny.statistics(field["name"]) == {k: field[k] for k in ("min", "max", "volume_integral", "cells_without_value")}


def test_a_mesh_of_arrays_has_the_values_where_the_indices_say():
    mesh = two_levels(lambda x, y, z: x + 10 * y + 100 * z)
    # centres: of a coarse cell, of a fine one
    assert mesh.sample([[0.125, 0.375, 0.875], [0.5625, 0.6875, 0.9375]], filter="nearest") == pytest.approx([91.375, 101.1875])
    assert mesh.leaf_cells == 64 - 8 + 64
    assert [level["ratio_to_finer"] for level in mesh.levels] == [2, 1]
    # the mean of x over the cube is 1/2 however it is cut
    assert two_levels().statistics()["volume_integral"] == pytest.approx(0.5)


@pytest.mark.parametrize("arrange", [np.asfortranarray, lambda a: a.astype(np.float32), lambda a: a[::-1][::-1], lambda a: a.astype(">f8"),
                                     lambda a: a.tolist()])
def test_arrays_of_any_order_and_type_are_one_mesh(arrange):
    values = np.arange(64.0).reshape(4, 4, 4)
    box = [[(0, 0, 0), (4, 4, 4)]]
    assert amrtex.hierarchy([0], box, [arrange(values)]).hash == amrtex.hierarchy([0], box, [values]).hash


def test_a_saved_mesh_of_arrays_is_the_same_mesh(tmp_path):
    mesh = two_levels(lower=(-1, 0, 2), upper=(1, 2, 4))
    mesh.save(tmp_path / "mesh.npz")
    again = amrtex.open(tmp_path / "mesh.npz")
    assert again.hash == mesh.hash
    assert again.domain.tolist() == [[-1, 0, 2], [1, 2, 4]]


def test_several_fields_are_drawn_and_sampled_by_name():
    box = [[(0, 0, 0), (2, 2, 2)]]
    mesh = amrtex.hierarchy([0], box, {"a": [np.zeros((2, 2, 2))], "b": [np.full((2, 2, 2), 3.0)]})
    assert mesh.fields == ["a", "b"]
    assert mesh.sample([0.5, 0.5, 0.5], field="b") == 3
    assert mesh.encode("uniform", field="b").sample([0.5, 0.5, 0.5]) == 3
    # a line integral along the whole cube, whose edge is 1
    assert mesh.render(field="b", mode="projection", view="+x", size=(3, 3))[1, 1] == pytest.approx(3, rel=1e-3)


def test_two_dimensional_arrays_are_a_slab():
    mesh = amrtex.hierarchy([0], [[(0, 0), (4, 2)]], [np.arange(8.0).reshape(4, 2)], upper=(4, 2))
    assert mesh.domain.tolist() == [[0, 0, 0], [4, 2, 1]]  # as deep as a cell's edge
    assert len(mesh.levels) == 1
    assert mesh.sample([2.5, 1.5, 0.5], filter="nearest") == 5


def test_nan_and_holes_are_places_without_a_value():
    values = np.ones((2, 2, 2))
    values[0, 0, 0] = np.nan
    mesh = amrtex.hierarchy([0], [[(0, 0, 0), (2, 2, 2)]], [values], root_cells=(2, 2, 4), upper=(1, 1, 2))
    assert np.isnan(mesh.sample([[0.1, 0.1, 0.1], [0.1, 0.1, 1.9]])).all()
    assert mesh.sample([0.9, 0.9, 0.9]) == 1


BOX = [[(0, 0, 0), (2, 2, 2)]]
CUBE = np.zeros((2, 2, 2))


@pytest.mark.parametrize("arguments, words", [
    (dict(levels=[0], boxes=BOX, values=[np.zeros((2, 2, 3))]), "shape (2, 2, 3); accepted: (2, 2, 2)"),
    (dict(levels=[0], boxes=BOX, values=[]), "0 arrays; accepted: 1"),
    (dict(levels=[0], boxes=BOX, values=None), "0 arrays; accepted: 1"),
    (dict(levels=[0], boxes=BOX, values={}), "no field"),
    (dict(levels=[0], boxes=BOX, values=[CUBE + 1j]), "accepted: real numbers"),
    (dict(levels=[0], boxes=BOX, values=[CUBE.astype(object)]), "accepted: real numbers"),
    (dict(levels=[], boxes=BOX, values=[CUBE]), "accepted: integers"),
    (dict(levels=[0.0], boxes=BOX, values=[CUBE]), "accepted: integers"),
    (dict(levels=[-1], boxes=BOX, values=[CUBE]), "patch 0 is of level -1"),
    (dict(levels=[2**62], boxes=BOX, values=[CUBE]), "is of level 4611686018427387904"),
    (dict(levels=[0], boxes=[[(0, 0, 0), (2, 2, 2**40)]], values=[np.zeros((2, 2, 1))]), "the size of its box"),
    (dict(levels=[0], boxes=[[(-1, 0, 0), (1, 2, 2)]], values=[CUBE]), "a corner is -1"),
    (dict(levels=[0], boxes=[[(2, 2, 2), (0, 0, 0)]], values=[CUBE]), "the size of its box"),
    (dict(levels=[0], boxes=np.array(BOX, dtype=float), values=[CUBE]), "boxes: type float64; accepted: integers"),
    (dict(levels=[0], boxes=[(0, 0, 0), (2, 2, 2)], values=[CUBE]), "boxes: shape (2, 3)"),
    (dict(levels=[0, 0], boxes=BOX * 2, values=[CUBE] * 2), "overlap"),
    (dict(levels=[1], boxes=BOX, values=[CUBE]), "root_cells"),
    (dict(levels=[0], boxes=BOX, values=[CUBE], root_cells=(1, 1, 1)), "level 0"),
    (dict(levels=[0], boxes=BOX, values=[CUBE], upper=(np.nan, 1, 1)), "upper"),
    (dict(levels=[0], boxes=BOX, values=[CUBE], upper=(0, 1, 1)), "domain"),
    (dict(levels=[0, 1], boxes=BOX * 2, values=[CUBE] * 2, ratios=1), "ratio"),
    (dict(levels=[0, 1], boxes=BOX * 2, values=[CUBE] * 2, ratios=[2, 2]), "accepted: one number, or 1"),
    (dict(levels=[0, 1], boxes=[BOX[0], [(0, 0, 0), (1, 1, 1)]], values=[CUBE, CUBE[:1, :1, :1]]), "level"),
])
def test_bad_arrays_are_errors_that_say_what_is_accepted(arguments, words):
    with pytest.raises(amrtex.Error, match=re.escape(words)):
        amrtex.hierarchy(**arguments)


# encodings


@pytest.mark.parametrize("name", amrtex.encodings())
def test_every_encoding_reads_the_value_of_the_leaf_cell(name, tiny):
    structure = tiny.encode(name, filter="nearest")
    points = np.random.default_rng(1).uniform(*tiny.domain, size=(10, 5, 3))
    expected = tiny.sample(points, filter="nearest")
    assert expected.shape == (10, 5)
    # to the bit in double; a float fraction may fall into the neighbouring cell, a float value is rounded
    assert structure.sample(points, "encoding_double") == pytest.approx(expected, rel=1e-7)
    assert np.mean(np.isclose(structure.sample(points), expected, rtol=1e-6)) > 0.95
    assert structure.encoding == name and structure.filter == "nearest"


def test_memory_is_that_of_records_and_its_roles_add_up(tiny):
    memory = tiny.encode("page_table", page_size=8, filter="linear_page").memory
    assert memory["total_bytes"] == sum(memory["by_role"].values()) > 0
    assert memory["texels_per_cell"] > 1


def test_samples_are_those_of_the_command_line(tiny, tmp_path):
    points = np.random.default_rng(2).uniform(-0.1, 1.1, size=(20, 3))
    np.savetxt(tmp_path / "points.txt", points, fmt="%.17g")
    told = json.loads(amrtex_program("sample", TINY, "--encoding", "octree", "--filter", "linear_lod", "--points", tmp_path / "points.txt", "--json",
                                     check=True).stdout)
    octree = tiny.encode("octree", filter="linear_lod", filtering="manual")
    for column in ("reference", "encoding_double", "encoding_gl"):
        expected = [np.nan if t[column] is None else t[column] for t in told]
        np.testing.assert_array_equal(octree.sample(points, column), expected)


# pictures


@pytest.mark.parametrize("keywords, options", [
    (dict(), []),
    (dict(mode="projection", view="+z", field="phi"), ["--mode", "projection", "--view", "+z", "--field", "phi"]),
    (dict(isovalue=1.3, encoding="exabricks", filter="basis"), ["--isovalue", "1.3", "--encoding", "exabricks", "--filter", "basis"]),
    (dict(range=(1, 1.5), colormap="magma", log=True), ["--range", "1", "1.5", "--colormap", "magma", "--log"]),
    (dict(camera=[2, 2, 2, 0.5, 0.5, 0.5, 0, 0, 1], fovy=30), ["--camera", "2", "2", "2", "0.5", "0.5", "0.5", "0", "0", "1", "--fovy", "30"]),
    (dict(set={"render.step": 0.25, "storage": "r8"}), ["--set", "render.step=0.25", "--set", "storage=r8"]),
    (dict(reference=True, reference_tolerance=1e-3), ["--reference", "--reference-tolerance", "1e-3"]),
])
def test_a_picture_is_that_of_the_command_line_to_the_bit(tiny, tmp_path, keywords, options):
    amrtex_program("render", TINY, "-o", tmp_path / "picture.npy", "--size", "24", "16", *options, check=True)
    expected = np.load(tmp_path / "picture.npy")
    picture = tiny.render(size=(24, 16), **keywords)
    assert picture.dtype == expected.dtype and picture.shape == expected.shape == (16, 24, expected.shape[2])
    np.testing.assert_array_equal(picture, expected)


def scene(**more):
    return {"name": "s", "datasets": [{"file": str(TINY), "field": "phi"}], "encodings": [{"name": "uniform"}], "filters": ["nearest"],
            "render": {"mode": "projection", "width": 16, "height": 16}, "views": [VIEW], **more}


def test_a_scene_is_drawn_as_a_file_a_dict_and_of_a_mesh_or_a_structure(tiny, tmp_path):
    file = tmp_path / "scene.json"
    file.write_text(json.dumps(scene()))
    amrtex_program("render", file, "-o", tmp_path / "picture.npy", check=True)
    expected = np.load(tmp_path / "picture.npy")
    structure = tiny.encode("uniform", filter="nearest")
    without_data = {key: value for key, value in scene().items() if key != "datasets"}
    for picture in (amrtex.render(file), amrtex.render(str(file)), amrtex.render(scene()), tiny.render(scene()), tiny.render(file),
                    tiny.render(without_data), structure.render(scene()), amrtex.render(structure, scene=scene())):
        np.testing.assert_array_equal(picture, expected)
    assert amrtex.render(scene(), size=(8, 4)).shape == (4, 8, 1)


def test_a_structure_draws_what_a_mesh_draws_by_its_encoding(tiny):
    structure = tiny.encode("kd_tree", filter="linear_lod")
    for keywords in (dict(), dict(isovalue=1.3), dict(mode="mip"), dict(view="+y", set={"consumer": "multipass"})):
        np.testing.assert_array_equal(structure.render(size=(16, 16), **keywords),
                                      tiny.render(encoding="kd_tree", filter="linear_lod", size=(16, 16), **keywords))


def test_written_pictures_are_read_again(tiny, tmp_path):
    picture = tiny.render(size=(8, 6))
    amrtex.write_picture(picture, tmp_path / "p.npy")
    np.testing.assert_array_equal(np.load(tmp_path / "p.npy"), picture)
    amrtex.write_picture(picture, tmp_path / "p.png", background=(1, 1, 1))
    assert (tmp_path / "p.png").read_bytes()[:4] == b"\x89PNG"
    for bad, name in ((np.zeros((2, 2)), "a.png"), (np.zeros((2, 2, 3)), "a.png"), (np.zeros((0, 2, 4)), "a.png"), (picture, "a.jpg"),
                      ("text", "a.png")):
        with pytest.raises(amrtex.UsageError, match="accepted"):
            amrtex.write_picture(bad, tmp_path / name)
    assert not (tmp_path / "a.png").exists()


def refused(program_arguments, call, kind=amrtex.UsageError):
    """The error has the text that the command line prints; which is cut where a line is full."""
    with pytest.raises(amrtex.Error) as caught:
        call()
    assert isinstance(caught.value, kind)
    line = amrtex_program(*program_arguments).stderr.removeprefix("amrtex: ").strip()
    assert line and line.endswith(str(caught.value))  # in front of which it may say where the data set is


def test_errors_have_the_text_of_the_command_line(tiny, tmp_path):
    out = tmp_path / "p.png"
    refused(["render", TINY, "-o", out, "--mode", "sideways"], lambda: tiny.render(mode="sideways"))
    refused(["render", TINY, "-o", out, "--encoding", "octre"], lambda: tiny.render(encoding="octre"))
    refused(["render", TINY, "-o", out, "--view", "up"], lambda: tiny.render(view="up"))
    refused(["render", TINY, "-o", out, "--tolerance", "2"], lambda: tiny.render(tolerance=2))
    refused(["render", TINY, "-o", out, "--set", "stepp=1"], lambda: tiny.render(set={"stepp": 1}))
    refused(["render", TINY, "-o", out, "--encoding", "octree", "--filter", "basis"], lambda: tiny.render(encoding="octree", filter="basis"),
            amrtex.UnsupportedError)
    refused(["render", TINY, "-o", out, "--memory-limit", "lots"], lambda: tiny.render(memory_limit="lots"))
    refused(["info", tmp_path / "no such"], lambda: amrtex.open(tmp_path / "no such"), amrtex.Error)
    refused(["report", tmp_path], lambda: amrtex.records(tmp_path), amrtex.Error)


@pytest.mark.parametrize("call, words", [
    (lambda m: m.render(sized=3), "no keyword 'sized'; accepted: field,"),
    (lambda m: m.render(size=3), "width and height"),
    (lambda m: m.render(size=(0, 4)), "width and height"),
    (lambda m: m.render(size=(1.5, 4)), "width and height"),
    (lambda m: m.render(range=(1, np.inf)), "two numbers"),
    (lambda m: m.render(range="ab"), "two numbers"),
    (lambda m: m.render(camera=[1, 2, 3]), "nine numbers"),
    (lambda m: m.render(fovy=30), "accepted: camera beside it"),
    (lambda m: m.render(field=3), "accepted: a text"),
    (lambda m: m.render(field="density"), "phi"),
    (lambda m: m.render(set={"step": np.nan}), "not JSON compliant"),
    (lambda m: m.render(set="step=1"), "a dict"),
    (lambda m: m.render({"name": {1, 2}}), "a set; accepted"),
    (lambda m: m.render(scene(), view="+x"), "--view: with a scene"),
    (lambda m: m.render(ROOT / "no such.json"), "no such.json"),
    (lambda m: m.render(scene(encodings=[{"name": "uniform"}, {"name": "octree"}])), "a scene file describes one picture"),
    (lambda m: m.encode("octre"), "octree"),
    (lambda m: m.encode("page_table", page_size=7), "page_size"),
    (lambda m: m.encode("page_table", pagesize=8), "page_size"),
    (lambda m: m.encode("page_table", page_size=[4, 8]), "one picture"),
    (lambda m: m.encode("uniform", storage="r7"), "storage"),
    (lambda m: m.encode("uniform", context="vulkan"), "egl"),
    (lambda m: m.encode("uniform", filter="basis"), "basis"),
    (lambda m: m.encode("uniform").render(encoding="octree"), "encoding: it is the structure's own"),
    (lambda m: m.encode("uniform").sample([1, 2]), "shape (..., 3)"),
    (lambda m: m.encode("uniform").sample([[0, 0, 0]], "gl"), "encoding_gl"),
    (lambda m: m.sample(np.zeros((2, 2))), "shape (..., 3)"),
    (lambda m: m.sample([[0, 0, 0]], filter="cubic"), "linear_vertex"),
    (lambda m: m.statistics("rho"), "phi"),
    (lambda m: m.save(TINY), "exists"),
    (lambda m: amrtex.open(TINY, ["rho"]), "phi"),
    (lambda m: amrtex.open(os.fsencode(TINY) + b"\xff"), "plt00008"),
])
def test_bad_calls_are_errors_that_say_what_is_accepted(tiny, call, words):
    with pytest.raises(amrtex.Error, match=re.escape(words)):
        call(tiny)


def test_more_memory_than_the_limit_is_an_error_before_it_is_allocated(tiny):
    with pytest.raises(amrtex.BudgetError, match="uniform"):
        tiny.encode("uniform", memory_limit="1KiB")


def test_points_without_a_mesh_have_no_value(tiny):
    points = [[np.nan, 0, 0], [np.inf, 0, 0], [-1, 0, 0], [1e300, 0, 0]]
    assert np.isnan(tiny.sample(points)).all()
    assert np.isnan(tiny.encode("octree").sample(points)).all()


# experiments


def experiment(**more):
    return {"name": "e", "datasets": [{"name": "tiny", "file": str(TINY), "field": "phi"}], "encodings": [{"name": "page_table", "page_size": [4, 8]}],
            "filters": ["nearest"], "render": {"mode": "projection", "step": [1.0, 0.5], "width": 16, "height": 16}, "views": [VIEW], "frames": 2,
            "warm_up": 0, **more}


def test_a_run_measures_every_point_and_goes_on(tmp_path):
    asked = amrtex.Experiment(experiment())
    assert [p["status"] for p in asked.points(tmp_path)] == ["open"] * 4
    heard = []
    summary = asked.run(tmp_path, where="page_size = 4", recorded=heard.append)
    assert (summary["measured"], summary["kept"]) == (2, 0)
    assert {r["build_parameters"]["page_size"] for r in heard} == {4}
    summary = asked.run(tmp_path)
    assert (summary["measured"], summary["kept"], summary["failed"]) == (2, 2, 0)
    found = amrtex.records(tmp_path)
    assert {r["configuration"] for r in found} == {p["configuration"] for p in asked.points()}
    assert [r["status"] for r in found] == ["ok"] * 4
    # what the command line makes of it
    assert "page_table" in amrtex_program("report", tmp_path, check=True).stdout
    flat = amrtex.records(tmp_path / "records.jsonl", flat=True)
    assert flat[0]["memory.total_bytes"] == found[0]["memory"]["total_bytes"]


def test_pandas_takes_records_as_they_are(tmp_path):
    pandas = pytest.importorskip("pandas", reason="no pandas here: package python3-pandas")
    amrtex.Experiment(experiment()).run(tmp_path, only=amrtex.Experiment(experiment()).points()[0]["configuration"])
    assert pandas.DataFrame(amrtex.records(tmp_path))["status"].tolist() == ["ok"]
    assert pandas.DataFrame(amrtex.records(tmp_path, flat=True))["memory.total_bytes"].tolist()[0] > 0


@pytest.mark.parametrize("call, words", [
    (lambda f: amrtex.Experiment(experiment(framse=2)), "frames"),
    (lambda f: amrtex.Experiment({}), "datasets"),
    (lambda f: amrtex.Experiment(experiment(datasets=[{"file": "nowhere"}])), "nowhere"),
    (lambda f: amrtex.Experiment(ROOT / "nowhere.json"), "nowhere.json"),
    (lambda f: amrtex.Experiment(experiment()).run(f, frames=2), "no keyword 'frames'"),
    (lambda f: amrtex.Experiment(experiment()).run(""), "out is missing"),
    (lambda f: amrtex.Experiment(experiment()).run(f, where="page = 4"), "page"),
    (lambda f: amrtex.Experiment(experiment()).run(f, repeat=0), "1 to 1000"),
    (lambda f: amrtex.Experiment(experiment()).run(f, time_limit=-1), "above 0"),
    (lambda f: amrtex.Experiment(experiment()).run(f, program="/no/amrtex"), "process"),
    (lambda f: amrtex.records(TINY / "Header"), "records.jsonl"),
])
def test_bad_experiments_are_errors(tmp_path, call, words):
    with pytest.raises(amrtex.Error, match=re.escape(words)):
        call(tmp_path)


def test_an_exception_of_the_listener_ends_the_run_and_keeps_the_record(tmp_path):
    def listen(record):
        raise KeyError(record["status"])

    with pytest.raises(KeyError, match="ok"):
        amrtex.Experiment(experiment()).run(tmp_path, recorded=listen)
    assert len(amrtex.records(tmp_path)) == 1
    assert amrtex.Experiment(experiment()).run(tmp_path)["kept"] == 1


# threads and interrupts


def test_other_threads_run_while_it_draws_and_any_thread_may_draw(tiny):
    counted, done, pictures = [0], threading.Event(), []

    def count():
        while not done.is_set():
            counted[0] += 1
            time.sleep(0.001)

    def draw():
        pictures.append(tiny.render(reference=True, size=(160, 160)))

    counter, drawer = threading.Thread(target=count), threading.Thread(target=draw)
    counter.start()
    drawer.start()
    before = counted[0]
    drawer.join()
    done.set()
    counter.join()
    assert counted[0] > before + 3
    assert pictures[0].shape == (160, 160, 4)


def interrupted(script, after, *arguments):
    """Runs a script until it says "ready", sends SIGINT after a while, and returns the process and the seconds that it took to end."""
    process = subprocess.Popen([sys.executable, "-B", "-c", script, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    began = time.monotonic()
    out, err = process.communicate(timeout=60)
    return process.returncode, out, err, time.monotonic() - began


def test_ctrl_c_ends_a_long_picture_at_once():
    code, out, err, seconds = interrupted("""
import amrtex, sys
mesh = amrtex.open(sys.argv[1])
print("ready", flush=True)
mesh.render(reference=True, reference_tolerance=1e-12, size=(4000, 4000))
print("drawn")
""", 0.3, TINY)
    assert code in (130, -signal.SIGINT) and "KeyboardInterrupt" in err and "drawn" not in out
    assert seconds < 10


def test_ctrl_c_ends_the_measuring_process_and_keeps_what_is_measured(tmp_path):
    long = experiment(render={"mode": "projection", "step": [1.0, 0.5], "width": 64, "height": 64}, frames=100000)
    code, out, err, seconds = interrupted("""
import amrtex, json, subprocess, sys
asked = amrtex.Experiment(json.loads(sys.argv[1]))
print("ready", flush=True)
try:
    asked.run(sys.argv[2])
except KeyboardInterrupt:
    print("ended", subprocess.run(["pgrep", "-f", "measure --out " + sys.argv[2]], capture_output=True, text=True).stdout.strip(), ".")
""", 2, json.dumps(long), tmp_path)
    assert code == 0, err
    assert out == "ended  .\n", "no process measures any more"
    assert seconds < 10


def test_a_forked_process_is_told_to_be_spawned(tiny):
    pid = os.fork()
    if pid == 0:
        try:
            amrtex.open(TINY)
        except amrtex.Error as error:
            os._exit(7 if "spawn" in str(error) else 1)
        os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 7


# what is written about it


def test_everything_public_has_a_docstring_and_types():
    for name in amrtex.__all__:
        thing = getattr(amrtex, name)
        assert thing.__doc__, name
        if isinstance(thing, type):
            for member in vars(thing):
                if not member.startswith("_"):
                    assert getattr(thing, member).__doc__, f"{name}.{member}"
    assert (pathlib.Path(amrtex.__file__).parent / "py.typed").exists()


def test_the_stubs_have_what_the_extension_has():
    def public(names):
        return {name for name in names if not name.startswith("_")}

    stubs = ast.parse((pathlib.Path(amrtex.__file__).parent / "_core.pyi").read_text(encoding="utf-8"))
    classes = {node.name: node for node in stubs.body if isinstance(node, ast.ClassDef)}
    functions = {node.name for node in stubs.body if isinstance(node, ast.FunctionDef)}
    assert public(classes) | functions == public(vars(amrtex._core))
    for name, node in classes.items():
        if issubclass(getattr(amrtex._core, name), Exception):
            continue
        members = {m.name if isinstance(m, ast.FunctionDef) else m.target.id for m in node.body}
        assert public(members) == public(vars(getattr(amrtex._core, name))), name


def test_every_argument_of_the_interface_has_a_type():
    source = ast.parse(pathlib.Path(amrtex.__file__).read_text(encoding="utf-8"))
    for function in (node for node in ast.walk(source) if isinstance(node, ast.FunctionDef)):
        assert function.returns is not None, function.name
        for argument in function.args.args + function.args.kwonlyargs:
            assert argument.arg == "self" or argument.annotation is not None, f"{function.name}: {argument.arg}"


def test_the_page_of_the_documentation_runs_as_it_is_written(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib", reason="no matplotlib here: package python3-matplotlib").use("Agg")
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(tmp_path)
    page = (ROOT / "docs/python.md").read_text(encoding="utf-8")
    blocks = [b for b in re.findall(r"^```(\w*)\n(.*?)^```$", page, flags=re.DOTALL | re.MULTILINE) if b[0] != "py"]
    assert [language for language, _ in blocks].count("python") >= 7
    names, printed = {}, ""
    for language, text in blocks:
        if language == "python":
            said = io.StringIO()
            with contextlib.redirect_stdout(said):
                exec(compile(text, "docs/python.md", "exec"), names)  # pylint: disable=exec-used
            printed = said.getvalue()
        else:
            assert printed == text
    # the page's pictures are those of its lines
    drawn, shown = (names["plt"].imread(str(file)) for file in (tmp_path / "picture.png", ROOT / "docs/images/python_picture.png"))
    assert drawn.shape == shown.shape and np.abs(drawn - shown).mean() < 0.01, "scripts of this page: docs/images is old"
    assert (tmp_path / "error_against_memory.svg").stat().st_size > 5000
