"""`python3 -m limn` is the program `limn`: that of the same installation or build, else that in PATH."""

import os
import pathlib
import shutil
import sys


def find_program():
    """The program's path; None if there is none."""
    package = pathlib.Path(__file__).resolve().parent
    for folder in package.parents:  # PREFIX/lib/…/limn, or BUILD/python/limn
        for program in (folder / "bin" / "limn", folder / "limn"):
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
