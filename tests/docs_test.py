"""The documentation holds together: links lead somewhere, figures and numbers are those of the program and of committed results.

  docs_test.py PROGRAM        PROGRAM: the built amrtex
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = sys.argv.pop(1) if len(sys.argv) > 1 else str(ROOT / "build/release/amrtex")
# `filters` needs a GL context, which not every machine has; the others are drawn from files and the CPU alone.
CHEAP_FIGURES = ["structures", "data_flow", "work_precision"]

LINK = re.compile(r"!?\[[^\]]*\]\(([^()\s]*(?:\([^()]*\))?[^()\s]*)\)")
ELSEWHERE = re.compile(r"[a-z]+:")  # http:, https:, mailto:


def pages():
    """Markdown files of the project: tracked ones, or all where there is no repository."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    if listed.returncode == 0:
        return [ROOT / name for name in sorted(listed.stdout.split("\n")) if name and (ROOT / name).exists()]
    return sorted(p for p in ROOT.rglob("*.md") if not {"build", "out"} & set(p.relative_to(ROOT).parts))


def prose(page):
    """The page without its fenced blocks of code."""
    return re.sub(r"^( *)```.*?^\1```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def anchors(page):
    """Anchors of the headings, as GitHub makes them."""
    found, seen = set(), {}
    for heading in re.findall(r"^#{1,6} +(.*?)\s*$", prose(page), flags=re.MULTILINE):
        shown = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").replace("*", "")
        anchor = re.sub(r"[^\w\- ]", "", shown.lower()).replace(" ", "-")
        count = seen.get(anchor, 0)
        seen[anchor] = count + 1
        found.add(anchor if count == 0 else f"{anchor}-{count}")
    return found


def broken_links(page):
    for target in LINK.findall(re.sub(r"`[^`\n]*`", "`code`", prose(page))):
        if ELSEWHERE.match(target):
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists():
            yield f"{page.relative_to(ROOT)}: {target}: no such file"
        elif anchor and (file.suffix != ".md" or anchor not in anchors(file)):
            yield f"{page.relative_to(ROOT)}: {target}: no such heading"


class Links(unittest.TestCase):
    def test_every_relative_link_and_anchor_leads_somewhere(self):
        self.assertEqual([line for page in pages() for line in broken_links(page)], [])

    def test_the_check_finds_what_is_broken(self):
        with tempfile.TemporaryDirectory(dir=ROOT) as folder:
            page = pathlib.Path(folder) / "page.md"
            page.write_text("# One, `two`\n[a](#one-two) [b](#three) [c](no.md) `[d](code.md)`\n```\n[e](code.md)\n```\n")
            found = [line.partition(": ")[2] for line in broken_links(page)]
            self.assertEqual(found, ["#three: no such heading", "no.md: no such file"])

    def test_every_page_of_docs_is_listed(self):
        index = (ROOT / "docs/README.md").read_text(encoding="utf-8")
        for page in (ROOT / "docs").glob("*.md"):
            if page.name != "README.md":
                self.assertIn(f"({page.name})", index)


def draw(*arguments):
    command = [sys.executable, "-B", str(ROOT / "scripts/draw_figures.py"), *arguments]
    return subprocess.run(command, capture_output=True, text=True)


class Figures(unittest.TestCase):
    def test_figures_are_what_the_program_draws_today(self):
        with tempfile.TemporaryDirectory() as folder:
            drawn = draw("--program", PROGRAM, "--out", folder, *CHEAP_FIGURES)
            self.assertEqual(drawn.returncode, 0, drawn.stderr)
            for name in CHEAP_FIGURES:
                with self.subTest(figure=name):
                    self.assertEqual(shapes(pathlib.Path(folder) / f"{name}.svg"), shapes(ROOT / f"docs/images/{name}.svg"),
                                     "draw it again: scripts/draw_figures.sh")

    def test_a_figure_is_the_same_bytes_whenever_it_is_drawn(self):
        with tempfile.TemporaryDirectory() as folder:
            for kind in ("svg", "pdf", "png"):
                drawn = []
                for name in ("first", "second"):
                    file = pathlib.Path(folder) / f"{name}.{kind}"
                    ended = subprocess.run([PROGRAM, "figure", str(ROOT / "docs/figures/sampling.json"), "-o", str(file)],
                                           capture_output=True, text=True)
                    self.assertEqual(ended.returncode, 0, ended.stderr)
                    drawn.append(file.read_bytes())
                with self.subTest(kind=kind):
                    self.assertEqual(drawn[0], drawn[1])

    def test_an_unknown_figure_names_those_there_are(self):
        drawn = draw("structure")
        self.assertEqual(drawn.returncode, 2)
        self.assertIn("structures, filters, data_flow, work_precision", drawn.stderr)


def shapes(figure):
    """A figure's lines; of embedded pictures the place alone, because compressed bytes differ between versions of zlib."""
    return re.sub(r'href="data:[^"]*"', "", figure.read_text(encoding="utf-8")).splitlines()


def commands_of(page):
    """Lines of the page's blocks of code that begin with `amrtex`."""
    blocks = re.findall(r"^```\n(.*?)^```", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return [line.split() for block in blocks for line in block.splitlines() if line.startswith("amrtex ")]


def draws():
    """Is there a GL context?"""
    found = subprocess.run([PROGRAM, "doctor", "--json"], capture_output=True, text=True)
    return '"egl"' in found.stdout and found.returncode == 0


class Commands(unittest.TestCase):
    def run_all(self, page):
        commands = commands_of(ROOT / "docs" / page)
        self.assertTrue(commands)
        with tempfile.TemporaryDirectory() as folder:
            for name in ("data", "docs", "experiments"):
                os.symlink(ROOT / name, pathlib.Path(folder) / name)
            os.mkdir(pathlib.Path(folder) / "out")
            for command in commands:
                few = ["--where", "encoding = kd_tree and storage = r8", "--set", "frames=1"] if command[1] == "run" else []
                with self.subTest(command=" ".join(command)):
                    ended = subprocess.run([PROGRAM, *command[1:], *few], cwd=folder, capture_output=True, text=True)
                    self.assertEqual(ended.returncode, 0, ended.stderr)
                    if command[1] == "run":
                        self.assertIn("smallest: kd_tree", ended.stdout)
                    written = [command[i + 1] for i, word in enumerate(command) if word in ("-o", "--save-scene")]
                    for name in written:
                        self.assertTrue((pathlib.Path(folder) / name).exists(), name)

    def test_every_command_from_a_file_to_a_table_works(self):
        if not draws():
            self.skipTest("no GL context")
        self.run_all("from_your_file.md")

    def test_every_command_of_the_colour_maps_works(self):
        if not draws():
            self.skipTest("no GL context")
        self.run_all("color_maps.md")

    def test_every_command_of_the_figures_works(self):
        if not draws():
            self.skipTest("no GL context")
        self.run_all("figures.md")


class Numbers(unittest.TestCase):
    def test_the_table_of_the_readme_comes_from_committed_results(self):
        table = draw("--program", PROGRAM, "--table").stdout
        self.assertIn("| octree |", table)
        self.assertIn(table, (ROOT / "README.md").read_text(encoding="utf-8"), "scripts/draw_figures.sh --table prints it")

    def test_the_observed_orders_come_from_the_committed_verification(self):
        observed = (ROOT / "experiments/verify/results/egl/table.md").read_text(encoding="utf-8")
        section = (ROOT / "docs/numerical_method.md").read_text(encoding="utf-8").partition("## Orders")[2].partition("\n## ")[0]
        told = re.findall(r"\| ([\d.]+), ([\d.]+) \|$", section, flags=re.MULTILINE)
        self.assertEqual(len(told), 13)
        for first, last in told:
            self.assertRegex(observed, rf"\| {re.escape(first)} \([^|]*\| {re.escape(last)} \(")

    def test_the_citation_has_the_version_of_the_project(self):
        version = re.search(r"project\(amrtex VERSION ([\d.]+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8"))[1]
        self.assertIn(f"\nversion: {version}\n", (ROOT / "CITATION.cff").read_text(encoding="utf-8"))


if __name__ == "__main__":
    unittest.main()
