"""What `cmake --install` puts in place works without the source folder.

  install_test.py BUILD_FOLDER
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

BUILD = sys.argv.pop(1)


class Installed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.prefix = pathlib.Path(cls.folder.name)
        subprocess.run(["cmake", "--install", BUILD, "--prefix", cls.folder.name], check=True, capture_output=True)
        cls.share = cls.prefix / "share/amrtex"

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def amrtex(self, *arguments):
        """Started in a folder of its own, found through PATH."""
        environment = {**os.environ, "PATH": f"{self.prefix / 'bin'}{os.pathsep}{os.environ['PATH']}"}
        done = subprocess.run(["amrtex", *arguments], cwd=self.prefix, env=environment, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done.stdout

    def test_the_program_lists_its_encodings(self):
        self.assertIn("page_table", [e["name"] for e in json.loads(self.amrtex("encodings", "--json"))])

    def test_the_sample_data_is_read_and_encoded(self):
        data = str(self.share / "data/amrex_tiny/plt00008")
        self.assertEqual(json.loads(self.amrtex("info", data, "--json"))["leaf_cells"], 25600)
        shown = json.loads(self.amrtex("structure", data, "--encoding", "octree", "--filter", "nearest", "--json"))
        self.assertEqual(len(shown["regions"]), 25600)

    def test_experiments_documentation_and_licence_are_there_and_records_are_not(self):
        for name in ("README.md", "LICENSE", "CITATION.cff", "docs/filters.md", "docs/papers.bib", "docs/images/structures.svg",
                     "experiments/README.md", "experiments/quickstart/experiment.json", "experiments/limits/scene.json",
                     "experiments/quickstart/results/table.md"):
            self.assertTrue((self.share / name).is_file(), name)
        self.assertEqual(list((self.share / "experiments").rglob("records")), [])


if __name__ == "__main__":
    unittest.main()
