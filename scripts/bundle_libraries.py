#!/usr/bin/env python3
"""Puts the libraries of an installed amrtex beside it, so that it starts where only a GL driver is.

  bundle_libraries.py PREFIX        copies them, and writes PREFIX/share/amrtex/licenses
  bundle_libraries.py --list PREFIX says what a bundle holds: library, package, licences

Every library that the program and its module for HDF5 need goes to PREFIX/lib/amrtex with the RUNPATH $ORIGIN; glibc stays the
machine's. Libraries of GL are opened by name while the program runs, so none is among them. Needs patchelf and dpkg.
"""
import pathlib
import re
import shutil
import subprocess
import sys

# of glibc: they belong to the machine's own loader
GLIBC = re.compile(r"^(ld-linux|libc|libm|libmvec|libdl|libpthread|librt|libresolv|libanl|libutil|libthread_db)(-x86-64)?\.so(\.|$)")
GL = re.compile(r"^lib(GL|GLX|EGL|OpenGL|GLdispatch|OSMesa|gallium|glapi|LLVM|vulkan|gbm|drm|nvidia|cuda)", re.IGNORECASE)


def run(*command):
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"bundle_libraries.py: {' '.join(command)}: {done.stderr.strip() or done.stdout.strip()}")
    return done.stdout


def libraries_of(file):
    """Name -> file of everything that the loader opens with `file`."""
    found = {}
    for line in run("ldd", str(file)).splitlines():
        match = re.match(r"\s*(\S+) => (.*?)( \(0x[0-9a-f]+\))?$", line)
        if match and match[2] == "not found":
            sys.exit(f"bundle_libraries.py: {file} needs {match[1]}, which is not on this machine")
        if match:
            found[match[1]] = pathlib.Path(match[2])
    return found


def package_of(library):
    """Debian's package of a file; its folders may be links to one another."""
    real = library.resolve()
    for path in dict.fromkeys([real, library, pathlib.Path(str(real).removeprefix("/usr")), pathlib.Path("/usr" + str(real))]):
        done = subprocess.run(["dpkg-query", "-S", str(path)], capture_output=True, text=True)
        if done.returncode == 0:
            return done.stdout.split(": ")[0].split(",")[0].split(":")[0]
    sys.exit(f"bundle_libraries.py: {library} is of no package, so its licence is not known")


def licences_of(text):
    """Names of the licences in a `copyright` file: exact where it has Debian's machine-readable form."""
    names = dict.fromkeys(name.strip() for name in re.findall(r"^License: *(\S.*)$", text, flags=re.MULTILINE))
    return ", ".join(names) or "see the text"


def copy_libraries(prefix):
    folder = prefix / "lib/amrtex"
    roots = [prefix / "bin/amrtex", folder / "libamrtex_hdf5.so"]
    libraries = {}
    for root in roots:
        libraries.update(libraries_of(root))
    libraries = {name: file for name, file in libraries.items() if not GLIBC.match(name)}
    for name in libraries:
        if GL.match(name):
            sys.exit(f"bundle_libraries.py: the program is linked to {name}: GL has to be opened by name")
    for name, file in sorted(libraries.items()):
        target = folder / file.resolve().name
        if file.resolve() == target.resolve():
            continue  # the bundle was made before
        shutil.copyfile(file.resolve(), target)
        target.chmod(0o755)
        run("patchelf", "--set-rpath", "$ORIGIN", str(target))
        if name != target.name:  # the version in the name is read again (bench/cli/newer_runtime.hpp)
            (folder / name).unlink(missing_ok=True)
            (folder / name).symlink_to(target.name)
    return libraries


def write_licences(prefix, libraries):
    folder = prefix / "share/amrtex/licenses"
    folder.mkdir(parents=True, exist_ok=True)
    rows = []
    for name, file in sorted(libraries.items()):
        package = package_of(file)
        version = run("dpkg-query", "-W", "-f=${Version}", package)
        text = pathlib.Path("/usr/share/doc", package, "copyright").read_text(encoding="utf-8", errors="replace")
        (folder / f"{package}.txt").write_text(text, encoding="utf-8")
        rows.append((name, package, version, licences_of(text), f"[text]({package}.txt)"))
    lines = ["# Libraries in this bundle", "", "Built by Debian, unchanged but for the folder in which they look for one another. Sources: the packages of",
             "these names and versions at https://snapshot.debian.org.", "", "| library | package | version | licences | text |", "|---|---|---|---|---|"]
    lines += [f"| {' | '.join(row)} |" for row in rows]
    (folder / "README.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def listed(prefix):
    """Rows of a bundle's list of licences."""
    text = (prefix / "share/amrtex/licenses/README.md").read_text(encoding="utf-8")
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| lib") and not line.startswith("| library ")]


def main():
    arguments = sys.argv[1:]
    if len(arguments) == 2 and arguments[0] == "--list":
        for row in listed(pathlib.Path(arguments[1])):
            print(f"{row[0]:28} {row[1]:24} {row[3]}")
        return
    if len(arguments) != 1 or arguments[0].startswith("-"):
        sys.exit(__doc__)
    prefix = pathlib.Path(arguments[0]).resolve()
    write_licences(prefix, copy_libraries(prefix))


if __name__ == "__main__":
    main()
