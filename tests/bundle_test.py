"""What `cpack` makes needs nothing but glibc 2.36 and a GL driver.

  bundle_test.py BUNDLE.tar.gz|BUILD_FOLDER     of a build folder the bundle is made first

Environment AMRTEX_BARE_ROOT=1: also in a bare root of Debian 12 with Mesa's driver packages alone (mmdebstrap, minutes).
"""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import unittest

BUNDLE = pathlib.Path(sys.argv.pop(1)).resolve()
GLIBC = (2, 36)
MOST_BYTES = 40 << 20
ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts"))
import bundle_libraries  # noqa: E402


def readelf(option, file):
    return subprocess.run(["readelf", "--wide", option, str(file)], check=True, capture_output=True, text=True).stdout


def needed(file):
    return re.findall(r"\(NEEDED\)\s+Shared library: \[(.*?)\]", readelf("-d", file))


class Bundle(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = tempfile.TemporaryDirectory()
        cls.bundle = BUNDLE
        if BUNDLE.is_dir():
            packed = pathlib.Path(cls.scratch.name, "packed")
            subprocess.run(["cpack", "-G", "TGZ", "-B", str(packed)], cwd=BUNDLE, check=True, capture_output=True)
            (cls.bundle,) = packed.glob("*.tar.gz")
        cls.unpacked = pathlib.Path(cls.scratch.name, "unpacked")
        with tarfile.open(cls.bundle) as archive:
            archive.extractall(cls.unpacked)
        (cls.prefix,) = cls.unpacked.iterdir()
        cls.libraries = cls.prefix / "lib/amrtex"
        files = [*cls.prefix.glob("bin/*"), *cls.libraries.iterdir()]
        cls.binaries = [f for f in files if not f.is_symlink() and f.read_bytes()[:4] == b"\x7fELF"]

    @classmethod
    def tearDownClass(cls):
        cls.scratch.cleanup()

    def amrtex(self, *words, **variables):
        command = [str(self.prefix / "bin/amrtex"), *words]
        return subprocess.run(command, capture_output=True, text=True, env={"HOME": "/nonexistent", **variables}, cwd=self.scratch.name)

    def test_it_is_small(self):
        self.assertLessEqual(self.bundle.stat().st_size, MOST_BYTES)

    def test_program_and_module_are_there(self):
        names = {b.name for b in self.binaries}
        self.assertIn("amrtex", names)
        self.assertIn("libamrtex_hdf5.so", names)
        self.assertGreater(len(names), 10)

    def test_every_library_but_glibc_travels_along(self):
        for binary in self.binaries:
            for name in needed(binary):
                if not bundle_libraries.GLIBC.match(name):
                    self.assertTrue((self.libraries / name).exists(), f"{binary.name} needs {name}")

    def test_no_library_of_gl_is_linked_or_bundled(self):
        for binary in self.binaries:
            for name in [binary.name, *needed(binary)]:
                self.assertNotRegex(name, bundle_libraries.GL)

    def test_the_program_starts_without_hdf5(self):
        for name in needed(self.prefix / "bin/amrtex"):
            self.assertNotRegex(name, "hdf5|curl|ssl")

    def test_nothing_is_newer_than_glibc_2_36(self):
        for binary in self.binaries:
            for version in re.findall(r"GLIBC_(\d+\.\d+)", readelf("--version-info", binary)):
                self.assertLessEqual(tuple(map(int, version.split("."))), GLIBC, binary.name)

    def test_libraries_look_for_one_another_beside_themselves(self):
        for binary in self.binaries:
            paths = re.findall(r"\((RPATH|RUNPATH)\)\s+Library \w+: \[(.*?)\]", readelf("-d", binary))
            expected = "$ORIGIN/../lib/amrtex" if binary.parent.name == "bin" else "$ORIGIN"
            self.assertEqual(paths, [("RUNPATH", expected)], binary.name)

    def test_licences_of_all_that_is_inside_are_listed(self):
        rows = {row[0]: row for row in bundle_libraries.listed(self.prefix)}
        ours = {"amrtex", "libamrtex_hdf5.so"}
        for binary in self.binaries:
            names = {binary.name, *(link.name for link in self.libraries.iterdir() if link.resolve() == binary.resolve())}
            if names & ours:
                continue
            (name,) = names & rows.keys()
            text = self.prefix / f"share/amrtex/licenses/{rows[name][1]}.txt"
            self.assertGreater(len(text.read_text(encoding="utf-8")), 100, name)
            self.assertTrue(rows[name][3], name)
        self.assertTrue((self.prefix / "share/amrtex/LICENSE").is_file())

    def test_what_people_look_for_is_there(self):
        for name in ("README.md", "gpu_check.sh", "share/amrtex/scripts/gpu_check.sh", "share/amrtex/experiments/gpu/README.md",
                     "share/amrtex/data/amrex_tiny/plt00008/Header"):
            self.assertTrue((self.prefix / name).is_file(), name)
        self.assertTrue(list((self.prefix / "share/amrtex/experiments/gpu/references").glob("*.npy")))

    def test_it_starts_with_an_empty_environment_in_a_second(self):
        self.amrtex("--version")  # from the disk
        start = time.monotonic()
        done = self.amrtex("--version")
        self.assertLess(time.monotonic() - start, 1)
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        data = str(self.prefix / "share/amrtex/data/amrex_tiny/plt00008")
        done = self.amrtex("info", data, "--json")
        self.assertEqual(json.loads(done.stdout)["leaf_cells"], 25600, done.stderr)

    def test_hdf5_files_are_read_by_the_module_and_refused_by_name_without_it(self):
        source = str(self.prefix / "share/amrtex/data/amrex_tiny/plt00008")
        file = pathlib.Path(self.scratch.name, "tiny.vtkhdf")
        done = self.amrtex("convert", source, str(file))
        self.assertEqual(done.returncode, 0, done.stderr)
        module = self.libraries / "libamrtex_hdf5.so"
        module.rename(module.with_suffix(".away"))
        try:
            done = self.amrtex("info", str(file))
            self.assertEqual(done.returncode, 1)
            self.assertEqual(done.stderr.count("\n"), 1)
            for part in ("tiny.vtkhdf", "HDF5", "libamrtex_hdf5.so"):
                self.assertIn(part, done.stderr)
            self.assertLessEqual(len(done.stderr), 401)
        finally:
            module.with_suffix(".away").rename(module)

    def test_without_a_driver_it_says_what_is_needed(self):
        data = str(self.prefix / "share/amrtex/data/amrex_tiny/plt00008")
        done = self.amrtex("render", data, "-o", "x.png", AMRTEX_EGL="/nonexistent/libEGL.so.1")
        self.assertEqual(done.returncode, 1)
        self.assertEqual(done.stderr.count("\n"), 1)
        for part in ("/nonexistent/libEGL.so.1", "needed", "AMRTEX_EGL"):
            self.assertIn(part, done.stderr)

    @unittest.skipUnless(os.environ.get("AMRTEX_BARE_ROOT") == "1", "the bare root takes minutes: AMRTEX_BARE_ROOT=1")
    @unittest.skipUnless(shutil.which("mmdebstrap") and os.geteuid() == 0, "needs mmdebstrap and root")
    def test_it_draws_in_a_bare_root_with_mesas_drivers(self):
        with tempfile.TemporaryDirectory() as scratch:
            root = pathlib.Path(scratch, "root")
            subprocess.run(["mmdebstrap", "--variant=minbase", "--include=libegl1,libegl-mesa0,libgl1-mesa-dri", "bookworm", str(root)],
                           check=True, capture_output=True)
            shutil.copytree(self.prefix, root / "opt/amrtex", symlinks=True)
            # with /proc: without it the loader knows no $ORIGIN
            inside = ["unshare", "--mount", "--pid", "--fork", f"--root={root}", "--mount-proc", "env", "-i", "HOME=/tmp",
                      "PATH=/usr/bin:/bin"]
            start = time.monotonic()
            done = subprocess.run([*inside, "/opt/amrtex/bin/amrtex", "--version"], capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertLess(time.monotonic() - start, 1)
            done = subprocess.run([*inside, "/opt/amrtex/bin/amrtex", "render", "/opt/amrtex/share/amrtex/data/amrex_tiny/plt00008", "-o",
                                   "/tmp/tiny.png", "--size", "64", "64"], capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertGreater((root / "tmp/tiny.png").stat().st_size, 500)
            done = subprocess.run([*inside, "/opt/amrtex/bin/amrtex", "doctor"], capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            for part in ("llvmpipe", "--context egl_device --device 0", "no OSMesa: libOSMesa.so.8"):
                self.assertIn(part, done.stdout)


if __name__ == "__main__":
    unittest.main()
