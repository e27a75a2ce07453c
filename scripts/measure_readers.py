#!/usr/bin/env python3
"""Measures what reading takes: pairs of our reader and a control, alternating, on files that this script makes.

    scripts/measure_readers.py PROGRAM [--megabytes 400] [--pairs 7] [--folder DIR] [--formats amrex chombo ...]

PROGRAM is `read_data` of the build. The control reads the same bytes into fresh memory of the same size: the data files of a plotfile or
an ExaBrick data set with as many threads, in pieces; HDF5 data sets with h5py. A table comes out: the medians, their ratio, and the memory
that the process took beyond its start beside the field in the file's type.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import shutil
import statistics
import subprocess
import sys
import time

import h5py
import numpy

PIECE = 2 << 20
EDGE = 32  # cells of a patch along an axis


def boxes_of(cells):
    """Lower corners of all patches of a level, x fastest."""
    return [(x, y, z) for z in range(0, cells, EDGE) for y in range(0, cells, EDGE) for x in range(0, cells, EDGE)]


def levels_for(megabytes, bytes_each, fields):
    """Two levels, of which the finer one covers an eighth of the domain: [(cells of the domain, corners of patches)]."""
    patches = megabytes * 10**6 / (EDGE**3 * bytes_each * fields)
    root = max(2, round((patches / 2) ** (1 / 3)))
    root += root % 2
    coarse = boxes_of(root * EDGE)
    fine = [b for b in boxes_of(2 * root * EDGE) if max(b) < root * EDGE]
    return [(root * EDGE, coarse), (2 * root * EDGE, fine)]


def values(random, dtype, count):
    return random.random(count, dtype=numpy.float32).astype(dtype)


def write_amrex(path, levels, dtype, fields, ghosts=0):
    """One data file for 64 patches, as codes write them."""
    random = numpy.random.default_rng(1)
    little = numpy.dtype(dtype).newbyteorder("<")
    real = "((8, (32 8 23 0 1 9 0 127)),(4, (4 3 2 1)))" if little.itemsize == 4 else "((8, (64 11 52 0 1 12 0 1023)),(8, (8 7 6 5 4 3 2 1)))"
    box_text = lambda lo, hi: "((%d,%d,%d) (%d,%d,%d) (0,0,0))" % (*lo, *hi)
    header = "HyperCLaw-V1.1\n%d\n%s\n3\n0\n%d\n0 0 0\n1 1 1\n" % (fields, "\n".join("f%d" % i for i in range(fields)), len(levels) - 1)
    header += "2 " * (len(levels) - 1) + "\n" + " ".join(box_text((0,) * 3, (c - 1,) * 3) for c, _ in levels) + "\n"
    header += "0 " * len(levels) + "\n" + "".join("%r %r %r\n" % ((1 / c,) * 3) for c, _ in levels) + "0\n0\n"
    for number, (cells, boxes) in enumerate(levels):
        header += "%d %d 0\n0\n" % (number, len(boxes)) + "0 1\n" * (3 * len(boxes)) + "Level_%d/Cell\n" % number
        folder = path / ("Level_%d" % number)
        folder.mkdir(parents=True)
        places = []
        for k, lo in enumerate(boxes):
            name = "Cell_D_%05d" % (k // 64)
            with open(folder / name, "ab") as out:
                places.append("FabOnDisk: %s %d\n" % (name, out.tell()))
                stored = box_text([c - ghosts for c in lo], [c + EDGE - 1 + ghosts for c in lo])
                out.write(("FAB %s%s %d\n" % (real, stored, fields)).encode())
                out.write(values(random, little, fields * (EDGE + 2 * ghosts) ** 3).tobytes())
        rows = "%d,%d\n" % (len(boxes), fields) + ("0," * fields + "\n") * len(boxes) + "\n"
        text = "1\n1\n%d\n%d\n(%d 0\n" % (fields, ghosts, len(boxes))
        text += "".join(box_text(lo, [c + EDGE - 1 for c in lo]) + "\n" for lo in boxes)
        (folder / "Cell_H").write_text(text + ")\n%d\n" % len(boxes) + "".join(places) + "\n" + rows + rows)
    (path / "Header").write_text(header)


def write_chombo(path, levels, dtype, fields, **options):
    random = numpy.random.default_rng(1)
    corners = numpy.dtype([(side + axis, "i4") for side in ("lo_", "hi_") for axis in "ijk"])
    with h5py.File(path, "w") as out:
        out.attrs.update({"num_components": fields, "num_levels": len(levels)})
        for i in range(fields):
            out.attrs["component_%d" % i] = numpy.bytes_("f%d" % i)
        out.create_group("Chombo_global").attrs["SpaceDim"] = 3
        for number, (cells, boxes) in enumerate(levels):
            level = out.create_group("level_%d" % number)
            level.attrs.update({"dx": 1 / cells, "ref_ratio": 2})
            level.attrs["prob_domain"] = numpy.array((0, 0, 0, cells - 1, cells - 1, cells - 1), corners)
            level["boxes"] = numpy.array([(*lo, *(c + EDGE - 1 for c in lo)) for lo in boxes], corners)
            level.create_dataset("data:datatype=0", data=values(random, dtype, len(boxes) * fields * EDGE**3), **options)


def write_flash(path, levels, dtype, fields, **options):
    random = numpy.random.default_rng(1)
    blocks = [(number, cells, lo) for number, (cells, boxes) in enumerate(levels) for lo in boxes]
    named = lambda kind: numpy.dtype([("name", "S80"), ("value", kind)])
    with h5py.File(path, "w") as out:
        out["sim info"] = numpy.array([(9,)], [("file format version", "i4")])
        out["integer scalars"] = numpy.array([(b"nxb", EDGE), (b"nyb", EDGE), (b"nzb", EDGE), (b"dimensionality", 3)], named("i4"))
        out["string scalars"] = numpy.array([(b"geometry", b"cartesian")], named("S80"))
        out["real runtime parameters"] = numpy.array([(a + b, v) for a in (b"x", b"y", b"z") for b, v in ((b"min", 0.0), (b"max", 1.0))], named("f8"))
        root = levels[0][0] // EDGE
        out["integer runtime parameters"] = numpy.array([(b"nblockx", root), (b"nblocky", root), (b"nblockz", root)], named("i4"))
        out["unknown names"] = numpy.array([[b"f%03d" % i] for i in range(fields)], "S4")
        out["refine level"] = numpy.array([number + 1 for number, _, _ in blocks], "i4")
        out["bounding box"] = numpy.array([[(c / cells, (c + EDGE) / cells) for c in lo] for _, cells, lo in blocks], "f4")
        for i in range(fields):
            out.create_dataset("f%03d" % i, data=values(random, dtype, len(blocks) * EDGE**3).reshape(-1, EDGE, EDGE, EDGE), **options)


def write_enzo(path, levels, dtype, fields, **options):
    random = numpy.random.default_rng(1)
    path.mkdir()
    root = levels[0][0]
    text = "TopGridRank = 3\nTopGridDimensions = %d %d %d\nRefineBy = 2\nDomainLeftEdge = 0 0 0\nDomainRightEdge = 1 1 1\n" % ((root,) * 3)
    (path / "run").write_text(text + "".join("DataLabel[%d] = f%d\n" % (i, i) for i in range(fields)) + "VersionNumber = 2.6\n")
    hierarchy, number = "", 0
    with h5py.File(path / "run.cpu0000", "w") as out:
        for level, (cells, boxes) in enumerate(levels):
            for k, lo in enumerate(boxes):
                number += 1
                group = out.create_group("Grid%08d" % number)
                for i in range(fields):
                    group.create_dataset("f%d" % i, data=values(random, dtype, EDGE**3).reshape(EDGE, EDGE, EDGE), **options)
                hierarchy += "Grid = %d\nGridRank = 3\nGridDimension = %d %d %d\n" % (number, *((EDGE + 6,) * 3))
                hierarchy += "GridStartIndex = 3 3 3\nGridEndIndex = %d %d %d\n" % ((EDGE + 2,) * 3)
                hierarchy += "GridLeftEdge = %.17g %.17g %.17g\n" % tuple(c / cells for c in lo)
                hierarchy += "GridRightEdge = %.17g %.17g %.17g\n" % tuple((c + EDGE) / cells for c in lo)
                hierarchy += "NumberOfBaryonFields = %d\nBaryonFileName = run.cpu0000\n" % fields
                last = k + 1 == len(boxes)
                hierarchy += "Pointer: Grid[%d]->NextGridThisLevel = %d\n" % (number, 0 if last else number + 1)
                if last:
                    more = number + 1 if level + 1 < len(levels) else 0
                    hierarchy += "Pointer: Grid[%d]->NextGridNextLevel = %d\n" % (number - len(boxes) + 1, more)
                hierarchy += "\n"
    (path / "run.hierarchy").write_text(hierarchy)


def write_vtkhdf(path, levels, dtype, fields, **options):
    random = numpy.random.default_rng(1)
    with h5py.File(path, "w") as out:
        root = out.create_group("VTKHDF")
        root.attrs.update({"Version": numpy.array([2, 2]), "Origin": numpy.zeros(3)})
        root.attrs["Type"] = numpy.bytes_("OverlappingAMR")
        root.attrs["GridDescription"] = numpy.bytes_("XYZ")
        for number, (cells, boxes) in enumerate(levels):
            level = root.create_group("Level%d" % number)
            level.attrs["Spacing"] = numpy.full(3, 1 / cells)
            level["AMRBox"] = numpy.array([[v for c in lo for v in (c, c + EDGE - 1)] for lo in boxes], "i4")
            for i in range(fields):
                level.create_dataset("CellData/f%d" % i, data=values(random, dtype, len(boxes) * EDGE**3), **options)


def write_exabrick(path, levels, dtype, fields, bricks):
    """Leaves alone, in blocks of 16 x 16 x 16, coarse ones first; each block is a brick."""
    random = numpy.random.default_rng(1)
    path.mkdir()
    block = 16
    steps = numpy.stack(numpy.meshgrid(*(range(block),) * 3, indexing="ij")[::-1], -1).reshape(-1, 3)
    count = 0
    with open(path / ("m.bricks" if bricks else "m.cells"), "wb") as out, open(path / "m.scalars", "wb") as scalars:
        for number, (cells, boxes) in enumerate(levels):
            level = len(levels) - 1 - number
            refined = 0 if level == 0 else cells // 2
            for lo in boxes:
                if max(lo) < refined:
                    continue
                for at in (numpy.array(lo) + block * numpy.array((x, y, z)) for z in (0, 1) for y in (0, 1) for x in (0, 1)):
                    if bricks:
                        numpy.array((block, block, block, *(at << level), level), "<i4").tofile(out)
                        numpy.arange(count, count + block**3, dtype="<i4").tofile(out)
                    else:
                        numpy.insert((at + steps) << level, 3, level, axis=1).astype("<i4").tofile(out)
                    values(random, dtype, block**3).tofile(scalars)
                    count += block**3


def read_pieces(path, offset, count):
    fresh = numpy.empty(count, numpy.uint8)
    with open(path, "rb", buffering=0) as file:
        done = 0
        while done < count:
            done += os.preadv(file.fileno(), [memoryview(fresh)[done:]], offset + done)
    return fresh


def control_files(path, pattern, threads):
    """All data files, in pieces, each into memory of its own."""
    pieces = [(f, at, min(PIECE, f.stat().st_size - at)) for f in path.glob(pattern) for at in range(0, f.stat().st_size, PIECE)]
    start = time.perf_counter()
    with concurrent.futures.ThreadPoolExecutor(threads) as pool:
        kept = list(pool.map(lambda p: read_pieces(*p), pieces))
    return time.perf_counter() - start, sum(k.size for k in kept)


def control_hdf5(path, wanted):
    file_path = path / "run.cpu0000" if path.is_dir() else path
    start = time.perf_counter()
    kept = []
    with h5py.File(file_path, "r") as file:
        names = []
        file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) and wanted(name) else None)
        for name in names:
            kept.append(file[name][...])
    return time.perf_counter() - start, sum(k.nbytes for k in kept)


def measure(program, path, control, pairs):
    ours, other, last = [], [], {}
    for _ in range(pairs + 1):
        other.append(control())
        last = json.loads(subprocess.run([program, path], check=True, capture_output=True, text=True).stdout)
        ours.append(last["read_seconds"])
    return statistics.median(ours[1:]), statistics.median(s for s, _ in other[1:]), last  # the first pair fills the system's cache


CASES = {
    # name: (writer, type, fields, options, bound of the ratio; None: the control does not do what costs the reader its time)
    "amrex f8": (write_amrex, "f8", 1, {}, 1.5),
    "amrex f4": (write_amrex, "f4", 1, {}, 1.5),
    "chombo f8": (write_chombo, "f8", 1, {}, 2),
    "chombo f4 deflate": (write_chombo, "f4", 1, {"chunks": (EDGE**3,), "compression": 1}, 2),
    "flash f4": (write_flash, "f4", 1, {}, 2),
    "enzo f8": (write_enzo, "f8", 1, {}, 2),
    "vtkhdf f4": (write_vtkhdf, "f4", 1, {}, 2),
    "exabrick cells f4": (write_exabrick, "f4", 1, {"bricks": False}, None),
    "exabrick bricks f4": (write_exabrick, "f4", 1, {"bricks": True}, None),
}
FILES = {"amrex": "Level_*/Cell_D_*", "exabrick": "m.*"}
WANTED = {"chombo": lambda n: n.endswith("data:datatype=0"), "flash": lambda n: n == "f000", "enzo": lambda n: n.endswith("/f0"), "vtkhdf": lambda n: n.endswith("CellData/f0")}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--megabytes", type=int, default=400)
    parser.add_argument("--pairs", type=int, default=7)
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path("out/readers"))
    parser.add_argument("--formats", nargs="*", default=[])
    arguments = parser.parse_args()
    threads = len(os.sched_getaffinity(0))
    print("| format | MB | read, s | control, s | ratio | bound | memory / field | memory − 1.3 field, MiB (bound 256) |\n|---|---|---|---|---|---|---|---|")
    failed = False
    for name, (writer, dtype, fields, options, bound) in CASES.items():
        kind = name.split()[0]
        if arguments.formats and kind not in arguments.formats and name not in arguments.formats:
            continue
        path = arguments.folder.absolute() / name.replace(" ", "_")
        if path.exists():
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        path.parent.mkdir(parents=True, exist_ok=True)
        levels = levels_for(arguments.megabytes, numpy.dtype(dtype).itemsize, fields)
        writer(path, levels, dtype, fields, **options)
        control = (lambda: control_files(path, FILES[kind], threads)) if kind in FILES else (lambda: control_hdf5(path, WANTED[kind]))
        ours, other, last = measure(arguments.program, path, control, arguments.pairs)
        over = (last["peak_bytes"] - 1.3 * last["field_bytes"]) / 2**20
        print("| %s | %d | %.3f | %.3f | %.2f | %s | %.2f | %.0f |"
              % (name, last["field_bytes"] / 1e6, ours, other, ours / other, bound or "-", last["peak_bytes"] / last["field_bytes"], over), flush=True)
        failed = failed or (bound is not None and ours > bound * other) or over > 256
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
