"""Folders of jobs become one.

  merge.py PROGRAM OUT FOLDER...

Records go through `amrtex merge`, which keeps contexts apart and refuses folders of two programs; pictures are linked beside them.
"""
import os
import pathlib
import shutil
import subprocess
import sys


def main():
    program, out, folders = sys.argv[1], pathlib.Path(sys.argv[2]), sys.argv[3:]
    done = subprocess.run([program, "merge", str(out), *folders], check=False).returncode
    if done != 0:
        sys.exit(done)
    for folder in folders:
        for part in ("pictures", "references"):
            for file in pathlib.Path(folder, part).glob("[!.]*"):
                target = out / part / file.name
                target.parent.mkdir(parents=True, exist_ok=True)
                if target.exists():
                    continue
                try:
                    os.link(file, target)
                except OSError:  # another file system
                    shutil.copy2(file, target)


if __name__ == "__main__":
    main()
