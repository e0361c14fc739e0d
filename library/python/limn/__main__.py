"""`python3 -m limn` is the program `limn`: that of the same installation or build, else that in PATH."""

import os
import pathlib
import shutil
import sys


def find_program():
    """The program's path; None if there is none."""
    package = pathlib.Path(__file__).resolve().parent
    build = package.parent.parent  # of BUILD/python/limn
    prefix = build.parent.parent  # of PREFIX/lib/python3/dist-packages/limn
    for program in (build / "limn", prefix / "bin" / "limn"):
        if program.is_file() and os.access(program, os.X_OK):
            return program
    return shutil.which("limn")


def main():
    program = find_program()
    if program is None:
        sys.exit(
            f"limn: expected the program `limn` beside {pathlib.Path(__file__).resolve().parent} or in PATH, found "
            "none. Install the package limn."
        )
    os.execv(program, [str(program), *sys.argv[1:]])


if __name__ == "__main__":
    main()
