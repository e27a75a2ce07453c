"""Every mutation of the list fits the text: its line stands where it says, once."""
import json
import pathlib
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
MUTATIONS = json.loads((ROOT / "tests/mutations/mutations.json").read_text(encoding="utf-8"))


class Mutations(unittest.TestCase):
    def test_each_fits_its_file(self):
        for m in MUTATIONS:
            with self.subTest(m["name"]):
                self.assertEqual((ROOT / m["file"]).read_text(encoding="utf-8").count(m["before"]), 1)
                self.assertNotEqual(m["before"], m["after"])

    def test_names_are_unique(self):
        names = [m["name"] for m in MUTATIONS]
        self.assertEqual(len(names), len(set(names)))

    def test_shaders_and_builders_have_theirs(self):
        shaders = sum(m["file"].endswith(".glsl") for m in MUTATIONS)
        self.assertGreaterEqual(shaders, 20)
        self.assertGreaterEqual(len(MUTATIONS) - shaders, 10)


if __name__ == "__main__":
    unittest.main()
