"""Draws the figures of README.md and docs/ from what the program itself says, and from committed results.

  draw_figures.py --program build/release/amrtex --out docs/images [FIGURE ...]

Figures: structures, filters, data_flow, work_precision; without names all of them.
"""
import argparse
import json
import math
import pathlib
import shutil
import subprocess
import sys
import tempfile

from svg import FAINT, INK, Axes, Svg, colour_of, hex_of

ROOT = pathlib.Path(__file__).resolve().parent.parent
COLOUR = {"uniform": "#4c566a", "page_table": "#1f77b4", "octree": "#2e8b3d", "kd_tree": "#d1432b", "exabricks": "#8a5fbf"}
LEVEL = ["#9aa3b2", "#e08a2e", "#c0392b"]

# What every encoding stores: a shell in a slab, on 3 levels of 8, 16 and 32 cells along its long edges.
SMALL_MESH = {"field": {"type": "shell", "center": [0, 0, 0.125], "radius": 0.35, "width": 0.05, "amplitude": 1},
              "levels": 3, "root": [8, 8, 2], "patch": 4, "max_patch": 16,
              "domain": {"lower": [0, 0, 0], "upper": [1, 1, 0.25]}, "refine": {"criterion": "gradient", "threshold": 0.3}}
# One level jump of ratio 4 along x, on each side of a bump; seen by every filter.
JUMP_MESH = {"field": {"type": "shell", "center": [-20, 2, 2], "radius": 26.95, "width": 2.2, "amplitude": 1},
             "levels": 2, "root": [12, 4, 4], "ratio": 4, "patch": 4,
             "domain": {"lower": [0, 0, 0], "upper": [12, 4, 4]}, "refine": {"criterion": "value", "threshold": 0.6}}

# How each encoding stores the small mesh: filter and build parameters.
STORED = [("uniform", "linear_page", []), ("page_table", "linear_page", ["page_size=4"]), ("octree", "linear_lod", []),
          ("kd_tree", "linear_lod", []), ("exabricks", "basis", [])]
# Each filter, through an encoding that has it, and what it does at a level jump.
FILTERS = [("nearest", "uniform", [], "jumps at every face"),
           ("linear_lod", "octree", [], "jumps where cells change level"),
           ("linear_page", "page_table", ["page_size=4"], "jumps where pages change level"),
           ("linear_vertex", "uniform", [], "continuous"),
           ("basis", "kd_tree", [], "continuous")]


class Program:
    """The command line, asked for JSON; meshes lie in a temporary folder."""

    def __init__(self, path, folder):
        self.path, self.folder = path, pathlib.Path(folder)

    def run(self, *arguments):
        done = subprocess.run([self.path, *arguments], capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"draw_figures: amrtex {arguments[0]} failed: {done.stderr.strip()}")
        return done.stdout

    def mesh(self, name, specification):
        folder = self.folder / name
        if not folder.exists():
            self.run("generate", json.dumps(specification), "-o", str(folder))
        return str(folder)

    def about(self, command, mesh, encoding, filter_name, parameters, *options):
        chosen = [word for p in parameters for word in ("--parameter", p)]
        return json.loads(self.run(command, mesh, "--encoding", encoding, "--filter", filter_name, *chosen, "--json", *options))

    def structure(self, *encoding_and_options):
        return self.about("structure", *encoding_and_options)

    def sample(self, mesh, encoding, filter_name, parameters, points):
        """The double reference at points."""
        file = self.folder / "points.txt"
        file.write_text("".join("%.17g %.17g %.17g\n" % p for p in points))
        rows = self.about("sample", mesh, encoding, filter_name, parameters, "--points", str(file))
        return [row["reference"] for row in rows]


# ---- structures: one mesh, and what every encoding keeps of it

MAP_EDGE = 160  # pixels of the slice of the mesh that is shown
SHEET_WIDTH = 290  # pixels
TEXEL = 2  # pixels


def middle(finest):
    """The slice of the mesh that is shown, in finest cells."""
    return finest[2] // 2


def draw_boxes(svg, left, top, finest, boxes, edge):
    """Boxes of finest cells that meet the slice, coarse ones first; y goes up."""
    scale = edge / finest[0]
    for b in sorted(boxes, key=lambda b: b["level"]):
        if not b["lower"][2] <= middle(finest) < b["upper"][2]:
            continue
        x, y = left + b["lower"][0] * scale, top + edge - b["upper"][1] * scale
        w, h = (b["upper"][0] - b["lower"][0]) * scale, (b["upper"][1] - b["lower"][1]) * scale
        svg.rect(x, y, w, h, "none", LEVEL[b["level"]], 1.2)


def leaf_rows(structure):
    """Values of the slice, one a finest cell, the top row first: of `uniform` under `nearest`, whose texture is the domain."""
    values = next(t["values"] for t in structure["textures"] if t["holds_values"])
    nx, ny, _ = structure["finest_cells"]
    z = middle(structure["finest_cells"])
    return [[values[(z * ny + y) * nx + x] for x in range(nx)] for y in reversed(range(ny))]


def layers_of(texture):
    """(width, height, depth, values): a buffer is one layer, in reading order."""
    nx, ny, nz = texture["size"]
    if ny > 1 or nz > 1:
        return nx, ny, nz, texture["values"]
    width = SHEET_WIDTH // TEXEL
    height = math.ceil(nx / width)
    return width, height, 1, texture["values"] + [None] * (width * height - nx)


def frame(sheet, left, top, width, height, colour=(176, 184, 196)):
    """A line below a layer and one to its right."""
    for row in sheet[top:top + height]:
        row[left + width - 1] = colour
    sheet[top + height - 1][left:left + width] = [colour] * width


def texel_sheet(texture, low, high):
    """Pixels of all layers of a texture, side by side with a line between them: every texel is there once."""
    nx, ny, nz, values = layers_of(texture)
    wide, tall = nx * TEXEL + 1, ny * TEXEL + 1
    across = min(max(1, SHEET_WIDTH // wide), nz)
    sheet = [[(255, 255, 255)] * (across * wide) for _ in range(math.ceil(nz / across) * tall)]
    for z in range(nz):
        frame(sheet, z % across * wide, z // across * tall, wide, tall)
    for i, value in enumerate(values):
        x, y, z = i % nx, i // nx % ny, i // (nx * ny)
        if value is None or value != value:
            continue
        left, top = z % across * wide + x * TEXEL, z // across * tall + y * TEXEL
        for row in sheet[top:top + TEXEL]:
            row[left:left + TEXEL] = [colour_of(value, low, high)] * TEXEL
    return sheet


def kibibytes(count):
    return f"{count / 1024:.1f} KiB" if count < 99.5 * 1024 else f"{count / 1024:.0f} KiB"


def draw_structure(svg, left, top, structure, low, high):
    name, right = structure["encoding"], left + MAP_EDGE + 16
    svg.text(left, top + 14, name, 15, COLOUR[name], weight="bold")
    pages = ", pages of 4³ cells" if name == "page_table" else ""
    svg.text(right, top + 14, f"filter {structure['filter']}{pages}", 11, FAINT)
    draw_boxes(svg, left, top + 24, structure["finest_cells"], [r for r in structure["regions"] if r["holds_mesh"]], MAP_EDGE)
    y = top + 24
    for texture in structure["textures"]:
        if "values" not in texture:
            continue
        sheet = texel_sheet(texture, low, high)
        svg.image(right, y, len(sheet[0]), len(sheet), sheet)
        y += len(sheet) + 4
    below = top + MAP_EDGE + 41
    svg.text(left, below, "1 region" if len(structure["regions"]) == 1 else f"{len(structure['regions'])} regions", 11)
    roles = structure["memory"]
    svg.text(right, below, kibibytes(sum(roles.values())), 11, INK, weight="bold")
    told = [f"{role} {count / 1024:.1f}" for role, count in roles.items() if count >= 52]  # what is not 0.0
    svg.text(left, below + 14, ", ".join(told) + " KiB", 11, FAINT)


def draw_mesh(svg, left, top, mesh, low, high):
    right = left + MAP_EDGE + 16
    svg.text(left, top + 14, "the mesh", 15, weight="bold")
    svg.text(right, top + 14, f"{mesh['leaf_cells']} leaf cells on {SMALL_MESH['levels']} levels; one slice", 11, FAINT)
    svg.image(left, top + 24, MAP_EDGE, MAP_EDGE, [[colour_of(v, low, high) for v in line] for line in leaf_rows(mesh)])
    svg.rect(right, top + 24, MAP_EDGE, MAP_EDGE, "#fafbfc", "none")
    draw_boxes(svg, right, top + 24, mesh["finest_cells"], mesh["patches"], MAP_EDGE)
    svg.text(left, top + MAP_EDGE + 41, "values", 11)
    svg.text(right, top + MAP_EDGE + 41, "patches of level", 11)
    for level, colour in enumerate(LEVEL):
        svg.text(right + 100 + 18 * level, top + MAP_EDGE + 41, str(level), 11, colour, weight="bold")


def structures(program):
    mesh = program.mesh("small", SMALL_MESH)
    cells = program.structure(mesh, "uniform", "nearest", [], "--texels")
    values = [v for line in leaf_rows(cells) for v in line]
    low, high = min(values), max(values)
    column, row = 484, 248
    svg = Svg(2 * column, 3 * row + 26, "One small mesh, and what each encoding stores of it")
    draw_mesh(svg, 14, 10, cells, low, high)
    for i, stored in enumerate(STORED, start=1):
        draw_structure(svg, 14 + (i % 2) * column, 10 + (i // 2) * row, program.structure(mesh, *stored, "--texels"), low, high)
    svg.text(14, 3 * row + 12, "Left: regions in the slice, in the colour of their level. Right: every texel of the value "
             "texture, layer by layer, at one scale: area is memory.", 12, INK)
    return svg


# ---- filters: one level jump

def jump_leaves(structure):
    """Leaf cells along the line that is drawn: (lower, upper, level), in finest cells."""
    leaves = {}
    y = z = structure["finest_cells"][1] // 2
    for patch in structure["patches"]:  # finer ones come later and win
        if all(patch["lower"][k] <= c < patch["upper"][k] for k, c in ((1, y), (2, z))):
            for x in range(patch["lower"][0], patch["upper"][0]):
                leaves[x] = patch["level"]
    width = {0: 4, 1: 1}
    return sorted({(x - x % width[l], x - x % width[l] + width[l], l) for x, l in leaves.items()})


def filters(program):
    mesh = program.mesh("jump", JUMP_MESH)
    leaves = jump_leaves(program.structure(mesh, "uniform", "nearest", []))
    pages = program.structure(mesh, "page_table", "linear_page", ["page_size=4"])["regions"]
    y = z = 2.3  # beside the cells' centres, as most of a picture is
    length, count = JUMP_MESH["root"][0], 1200
    points = [((i + 0.5) * length / count, y, z) for i in range(count)]
    svg = Svg(960, 5 * 128 + 82, "What each filter makes of one level jump")
    for i, (name, encoding, parameters, told) in enumerate(FILTERS):
        values = program.sample(mesh, encoding, name, parameters, points)
        axes = Axes(svg, (200, 14 + 128 * i, 740, 112), (0, length), (-0.08, 1.12))
        draw_leaves(axes, leaves, program, mesh, y, z)
        if name == "linear_page":
            draw_page_ends(axes, pages)
        draw_curve(axes, points, values)
        svg.rect(*axes.box, "none", "#b8bec8")
        svg.text(14, axes.box[1] + 50, name, 14, weight="bold")
        svg.text(14, axes.box[1] + 68, told, 11, FAINT)
    bottom = 14 + 128 * 5
    for x in range(length + 1):
        svg.text(axes.x(x), bottom, str(x), 11, FAINT, "middle")
    svg.text(570, bottom + 18, "x, in cells of level 0", 12, INK, "middle")
    svg.text(14, bottom + 40, "Bars: leaf cells along the line and their values; level 0 grey, level 1 (four times as fine) "
             "orange. Line: f(x) of the double reference.", 12, FAINT)
    svg.text(14, bottom + 57, "Dashes: ends of pages of 4³ cells. A page with an orange cell in it has level 1; "
             "there a grey cell's value stands still.", 12, FAINT)
    return svg


def draw_leaves(axes, leaves, program, mesh, y, z):
    centres = [((a + b) / 8, y, z) for a, b, _ in leaves]
    values = program.sample(mesh, "uniform", "nearest", [], centres)
    for (a, b, level), value in zip(leaves, values):
        x0, x1 = axes.x(a / 4), axes.x(b / 4)
        axes.svg.rect(x0, axes.y(value), x1 - x0, axes.y(0) - axes.y(value), ["#e4e7ec", "#fbe3c8"][level], "#ffffff", 0.8)


def draw_page_ends(axes, pages):
    for x in sorted({p["lower"][0] for p in pages if p["lower"][0] > 0}):
        axes.svg.line(axes.x(x / 4), axes.box[1], axes.x(x / 4), axes.box[1] + axes.box[3], FAINT, 1, "3 3")


def draw_curve(axes, points, values, jump=0.03):
    """The line is broken where f jumps."""
    piece = []
    for (x, _, _), value in zip(points, values):
        if piece and abs(value - piece[-1][1]) > jump:
            axes.svg.polyline([(axes.x(a), axes.y(b)) for a, b in piece], "#1f4e9c", 2)
            piece = []
        piece.append((x, value))
    axes.svg.polyline([(axes.x(a), axes.y(b)) for a, b in piece], "#1f4e9c", 2)


# ---- the flow of data

BOXES = {  # name: left, top, width, lines; the first is bold
    "file": (14, 20, 190, ["data set, specification", "plotfile or generated mesh"]),
    "mesh": (14, 116, 190, ["AmrHierarchy", "levels, patches, leaf cells"]),
    "field": (264, 116, 190, ["EncodedField", "textures, buffers, GLSL text"]),
    "gpu": (524, 20, 172, ["GpuField", "uploaded, bound by name"]),
    "cpu": (524, 116, 172, ["that GLSL as C++", "in float and in double"]),
    "picture": (796, 20, 150, ["picture", "samples, regions, time"]),
    "reference": (264, 226, 190, ["HierarchyReference", "filters in double, by search"]),
    "truth": (524, 226, 172, ["reference picture", "in double"]),
    "record": (796, 116, 150, ["record", "memory, time, error"]),
    "table": (796, 226, 150, ["tables, diagrams", ""]),
}
ARROWS = [("file", "mesh", "read"), ("mesh", "field", "build"), ("field", "gpu", "upload"), ("field", "cpu", ""),
          ("gpu", "picture", "draw"), ("mesh", "reference", ""), ("reference", "truth", "integrate"),
          ("truth", "record", "compare"), ("picture", "record", "measure"), ("cpu", "record", "error by cause"),
          ("record", "table", "report")]
MOVED = {"upload": (-24, 0), "compare": (30, 14)}  # labels, from beside the arrow's middle
BOX_HEIGHT = 52


def data_flow(_program):
    svg = Svg(960, 322, "From mesh to report")
    svg.rect(252, 214, 456, 76, "#eef4ec", "none", rx=8)
    svg.text(264, 308, "shares no code with encodings and shaders", 11, FAINT)
    for start, end, label in ARROWS:
        draw_arrow(svg, BOXES[start], BOXES[end], label)
    for left, top, width, lines in BOXES.values():
        svg.rect(left, top, width, BOX_HEIGHT, "#f3f6fb", "#7d8ba3", 1.2, 6)
        svg.text(left + width / 2, top + (22 if lines[1] else 31), lines[0], 13, INK, "middle", "bold")
        svg.text(left + width / 2, top + 40, lines[1], 11, FAINT, "middle")
    return svg


def draw_arrow(svg, a, b, label):
    """Sideways where b lies to the right of a, else down."""
    moved = MOVED.get(label, (0, 0))
    if b[0] >= a[0] + a[2]:
        start, end = (a[0] + a[2], a[1] + BOX_HEIGHT / 2), (b[0] - 2, b[1] + BOX_HEIGHT / 2)
        place, anchor = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2 - 7), "middle"
    else:
        start, end = (a[0] + a[2] / 2, a[1] + BOX_HEIGHT), (b[0] + b[2] / 2, b[1] - 2)
        place, anchor = (start[0] + 8, (start[1] + end[1]) / 2 + 4), "start"
    svg.line(*start, *end, "#5b6880", 1.4, arrow=True)
    svg.text(place[0] + moved[0], place[1] + moved[1], label, 11, INK, anchor)


# ---- error against time: what `amrtex report` makes of committed results

RESULTS = ROOT / "experiments/work_precision/results"


def report(program):
    """A folder with the report of the committed records."""
    folder = program.folder / "report"
    if not folder.exists():
        folder.mkdir()
        for path in (RESULTS / "records.jsonl.gz", RESULTS.parent / "tables.json"):
            shutil.copy(path, folder)
        program.run("report", str(folder))
    return folder


def work_precision(program):
    plot, = (report(program) / "plots").glob("front_time_*.svg")
    return plot.read_text(encoding="utf-8")


def fastest_table(program, least_db=50):
    """Markdown: of each encoding the fastest setting that reaches `least_db`."""
    tables = (report(program) / "table.md").read_text(encoding="utf-8")
    section = tables.partition(f"the fastest setting of each encoding at {least_db} dB")[2].partition("\n### ")[0]
    return "".join(line + "\n" for line in section.splitlines() if line.startswith("|"))


FIGURES = {f.__name__: f for f in (structures, filters, data_flow, work_precision)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figures", nargs="*", metavar="FIGURE", help=", ".join(FIGURES))
    parser.add_argument("--program", default=str(ROOT / "build/release/amrtex"), help="the program amrtex")
    parser.add_argument("--out", default=ROOT / "docs/images", type=pathlib.Path, help="folder for the SVG files")
    parser.add_argument("--table", action="store_true", help="print the table of README.md instead")
    a = parser.parse_args()
    unknown = [f for f in a.figures if f not in FIGURES]
    if unknown:
        parser.error(f"no figure {unknown[0]}; accepted: {', '.join(FIGURES)}")
    with tempfile.TemporaryDirectory() as folder:
        program = Program(a.program, folder)
        if a.table:
            print(fastest_table(program), end="")
            return
        a.out.mkdir(parents=True, exist_ok=True)
        for name in a.figures or FIGURES:
            (a.out / f"{name}.svg").write_text(str(FIGURES[name](program)), encoding="utf-8")


if __name__ == "__main__":
    main()
