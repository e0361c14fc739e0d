"""What the package shows: names, stubs, docstrings, the program."""

import ast
import inspect
import os
import pathlib
import re
import subprocess
import sys
import unittest

import limn

PACKAGE = pathlib.Path(limn.__file__).parent
STUB = ast.parse((PACKAGE / "__init__.pyi").read_text())
# What pybind11 and Python give to every class.
GIVEN = {"__doc__", "__module__", "__new__", "__hash__", "__dict__", "__weakref__", "__reduce__", "__repr__", "__init__"}


def public(names):
    return {name for name in names if not name.startswith("_")}


def stub_members(node):
    return {
        item.name if isinstance(item, ast.FunctionDef) else item.target.id
        for item in node.body
        if isinstance(item, (ast.FunctionDef, ast.AnnAssign))
    }


def stub_arguments(function):
    """[(name, has a default, keyword only)] without self."""
    arguments = function.args
    plain = [a.arg for a in arguments.args]
    first_default = len(plain) - len(arguments.defaults)
    listed = [(name, i >= first_default, False) for i, name in enumerate(plain)]
    for argument, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True):
        listed.append((argument.arg, default is not None, True))
    return [argument for argument in listed if argument[0] != "self"]


def runtime_arguments(doc):
    """The same from the signature that pybind11 writes in the first line of a docstring."""
    text = doc.splitlines()[0]
    text = re.sub(r"numpy\.ndarray\[[^]]*\]", "array", text[text.index("(") + 1 : text.rindex(") ->")])
    for _ in range(3):  # the commas in List[…], Tuple[…] and in defaults
        text = re.sub(r"[(\[][^()\[\]]*[)\]]", "…", text)
    listed, is_keyword = [], False
    for word in filter(None, text.split(", ")):
        if word == "*":
            is_keyword = True
        elif not word.startswith("self"):
            listed.append((word.split(":")[0], " = " in word, is_keyword))
    return listed


class Surface(unittest.TestCase):
    def test_is_in_the_stub_the_package_and_the_module(self):
        stub = {node.name for node in STUB.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
        self.assertEqual(set(limn.__all__) - {"__version__"}, stub)
        self.assertEqual(public(vars(limn._limn)), stub)

    def test_classes_have_the_members_of_the_stub(self):
        for node in STUB.body:
            if isinstance(node, ast.ClassDef) and not issubclass(getattr(limn, node.name), Exception):
                members = {name for name in vars(getattr(limn, node.name)) if "pybind11" not in name} - GIVEN
                self.assertEqual(members, stub_members(node) - GIVEN, node.name)

    def test_arguments_are_those_of_the_stub(self):
        count = 0
        for node in STUB.body:
            owner, functions = limn, [node]
            if isinstance(node, ast.ClassDef):
                owner, functions = getattr(limn, node.name), node.body
            for function in functions:
                if not isinstance(function, ast.FunctionDef) or function.decorator_list:
                    continue
                if function.name in ("__eq__", "__mul__"):
                    continue
                with self.subTest(function=f"{node.name}.{function.name}"):
                    doc = getattr(owner, function.name).__doc__
                    self.assertEqual(runtime_arguments(doc), stub_arguments(function))
                    count += 1
        self.assertGreater(count, 30)

    def test_everything_public_has_a_docstring(self):
        count = 0
        for name in limn.__all__:
            thing = getattr(limn, name)
            if name == "__version__":
                continue
            things = {name: thing}
            if inspect.isclass(thing):
                things.update({f"{name}.{key}": vars(thing)[key] for key in public(vars(thing))})
            for path, one in things.items():
                if isinstance(one, staticmethod):
                    one = one.__func__
                # Without the signature, which pybind11 writes first.
                text = re.sub(r"^\w+\(.*\) -> .*\n", "", one.__doc__ or "").strip()
                self.assertGreaterEqual(len(text), 4, path)
                count += 1
        self.assertGreater(count, 100)

    def test_the_package_is_typed(self):
        self.assertTrue((PACKAGE / "py.typed").is_file())

    def test_import_loads_neither_numpy_nor_matplotlib(self):
        code = "import sys, limn; print(sorted({'numpy', 'pathlib', 'matplotlib'} & set(sys.modules)))"
        self.assertEqual(subprocess.check_output([sys.executable, "-c", code], text=True).strip(), "[]")


class Program(unittest.TestCase):
    def test_is_that_of_the_same_build(self):
        text = subprocess.check_output([sys.executable, "-m", "limn", "--version"], text=True)
        self.assertEqual(text.strip(), f"limn {limn.__version__}")

    def test_gets_its_arguments_and_its_exit_code(self):
        done = subprocess.run([sys.executable, "-m", "limn", "detect", "no image.png"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("no image.png: ", done.stderr)

    def test_says_that_it_is_not_installed(self):
        code = "import runpy, limn.__main__ as m; m.__file__ = '/nowhere/limn/__main__.py'; m.main()"
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, "PATH": "/nowhere"}
        )
        self.assertEqual(done.returncode, 1)
        self.assertIn("expected the program `limn` beside /nowhere/limn or in PATH, found none", done.stderr)


if __name__ == "__main__":
    unittest.main()
