"""What a computation reaches of the source, so that a stored answer knows when the code that made it has changed.

Only statements count: comments, docstrings, layout, and imports for type checkers alone change nothing. A module
reaches the modules of this package, and of its own, that it imports at any place in it. What the registry finds by
folder is not imported: of the components only those that are named are reached, and those that code names itself.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import json
import sys
import textwrap
import uuid
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from importlib.util import cache_from_source
from pathlib import Path
from typing import Any

from bayesmembrane.ground.errors import StorageError
from bayesmembrane.ground.files import write_text

PACKAGE = __name__.partition(".")[0]
ROOT = Path(__file__).resolve().parents[2]
NUMERICAL = ("emcee", "numpy", "scipy", "numba")
"""Packages whose next major version may answer otherwise; a minor one may not."""
_PROCESS = uuid.uuid4().hex


def reached(entries: Iterable[str], components: Iterable[type[Any]] = (), root: Path = ROOT) -> dict[str, str]:
    """Name -> SHA-256 of the statements of every module that ``entries`` (dotted names) and ``components`` reach.

    ``root`` is the folder that holds this package. Classes that stand in no module's file, such as those of a notebook,
    come under their own names. Raises `StorageError` for an entry that is not there.
    """
    folders, found, ahead = {PACKAGE: root}, dict[str, str](), list[str]()
    for name in entries:
        if _path(name, folders) is None:
            raise StorageError(f'there is no module "{name}" to take a fingerprint of', str(root))
        ahead.append(name)
    for part in (p for component in components for p in _own_classes(component)):
        if _stands_in_a_module(part, folders):
            ahead.append(part.__module__)
        else:
            found[f"{part.__module__}.{part.__qualname__}"] = _class_digest(part)
    memory = _Memory(root)
    while ahead:
        name = ahead.pop()
        path = _path(name, folders)
        if name in found or path is None:
            continue
        found[name], imports = memory.module(name, path)
        ahead += (i for i in (*imports, *_parents(name)) if i != PACKAGE)
    memory.keep()
    return dict(sorted(found.items()))


def majors(packages: Iterable[str] = NUMERICAL) -> dict[str, str]:
    """The major versions of packages, by name."""
    return {name: installed(name).partition(".")[0] for name in packages}


@cache
def installed(package: str) -> str:
    """The version of a package: to find it, its folder is searched.

    Raises `importlib.metadata.PackageNotFoundError` where there is none.
    """
    return version(package)


def digest(values: Mapping[str, Any]) -> str:
    """SHA-256 of plain values, whatever the order of their names."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


# ---- where modules stand ---------------------------------------------------------------------------------------------


def _path(name: str, folders: Mapping[str, Path]) -> Path | None:
    """The file of a module under the folder of its top package; None for packages that are not followed."""
    folder = folders.get(name.partition(".")[0])
    if folder is None:
        return None
    stem = folder.joinpath(*name.split("."))
    for path in (stem.with_suffix(".py"), stem / "__init__.py"):
        if path.is_file():
            return path
    return None


def _parents(name: str) -> Iterator[str]:
    """The packages that hold a module, without the topmost: that is a door, and not what a computation needs."""
    parts = name.split(".")
    yield from (".".join(parts[:i]) for i in range(2, len(parts)))


def _own_classes(component: type[Any]) -> Iterator[type[Any]]:
    """The class and its bases, but for those of the standard library."""
    for part in component.__mro__:
        if part.__module__.partition(".")[0] not in sys.stdlib_module_names or part.__module__ == "__main__":
            yield part


def _stands_in_a_module(part: type[Any], folders: dict[str, Path]) -> bool:
    """Whether the module of a class is a file that imports lead to; where its package lies is added to ``folders``.

    What runs as a script or a notebook is more than the class, and changes without it.
    """
    file = getattr(sys.modules.get(part.__module__), "__file__", None)
    if part.__module__ == "__main__" or file is None:
        return False
    place = Path(file).resolve()
    depth = part.__module__.count(".") + (place.name == "__init__.py")
    folders.setdefault(part.__module__.partition(".")[0], place.parents[depth])
    found = _path(part.__module__, folders)
    return found is not None and (part.__module__.startswith(f"{PACKAGE}.") or found.resolve() == place)


def _class_digest(part: type[Any]) -> str:
    """Of the statements of a class that stands in no module's file; where they are not known, one of this process."""
    try:
        source = textwrap.dedent(inspect.getsource(part))
    except (OSError, TypeError):
        return f"{_PROCESS} {id(part)}"
    return _read(ast.parse(source), part.__module__)[0]


# ---- statements ------------------------------------------------------------------------------------------------------


class _Memory:
    """Digests and imports of modules by their text, kept beside Python's own compiled files: parsing takes long."""

    def __init__(self, root: Path) -> None:
        self.path = Path(cache_from_source(str(root / PACKAGE / "fingerprint.py"))).with_suffix(".json")
        self.known = _kept(self.path)
        self.new = False

    def module(self, name: str, path: Path) -> tuple[str, list[str]]:
        """(digest of the statements, imported names) of a module."""
        text = path.read_bytes()
        key = hashlib.sha256(f"{name} {path.name} ".encode() + text).hexdigest()
        if key not in self.known:
            package = name if path.name == "__init__.py" else name.rpartition(".")[0]
            self.known[key] = _read(ast.parse(text), package)
            self.new = True
        return self.known[key]

    def keep(self) -> None:
        """Write what is new; a folder that is closed costs time the next time, and nothing else."""
        if self.new:
            with suppress(StorageError):
                write_text(self.path, json.dumps(self.known), "the fingerprints of modules")


@cache
def _kept(path: Path) -> dict[str, tuple[str, list[str]]]:
    """What was kept, read once a process and added to in place; empty if there is nothing, or nothing readable."""
    with suppress(OSError, ValueError, TypeError):
        stored = json.loads(path.read_text(encoding="utf-8"))
        return {str(key): (str(digest), list(imports)) for key, (digest, imports) in stored.items()}
    return {}


def _read(tree: ast.AST, package: str) -> tuple[str, list[str]]:
    """SHA-256 of the statements of a syntax tree, and the dotted names that it imports and that may be modules."""
    parts: list[str] = []
    imports: set[str] = set()
    _write(tree, parts)
    for node in _imports(tree):
        if isinstance(node, ast.Import):
            imports.update(alias.name for alias in node.names)
        else:
            above = package.split(".")
            base = above[: len(above) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            imports.update((module, *(f"{module}.{alias.name}" for alias in node.names)))
    return hashlib.sha256("".join(parts).encode("utf-8", "surrogatepass")).hexdigest(), sorted(imports)


def _imports(node: ast.AST) -> Iterator[ast.Import | ast.ImportFrom]:
    """The imports among the statements in a node, at any depth, but for those that only type checkers see."""
    for name in ("body", "orelse", "handlers", "finalbody", "cases"):
        # An expression can have a body too, and no statements in it.
        inner = getattr(node, name, ())
        for child in inner if isinstance(inner, list) else ():
            if isinstance(child, ast.Import | ast.ImportFrom):
                yield child
            elif not _idle(child):
                yield from _imports(child)


def _idle(node: object) -> bool:
    """Docstrings, and what only type checkers see."""
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def _write(node: ast.AST, parts: list[str]) -> None:
    """Node types, fields and constants, without places and empty fields: in these the versions of Python differ."""
    for name in node._fields:
        value = getattr(node, name, None)
        if isinstance(value, ast.AST):
            parts += (name, "=", type(value).__name__, "(")
            _write(value, parts)
            parts.append(")")
        elif isinstance(value, list):
            if not value:
                continue
            parts += (name, "=[")
            for each in value:
                if not isinstance(each, ast.AST):
                    parts += (repr(each), ",")
                elif not _idle(each):
                    parts += (type(each).__name__, "(")
                    _write(each, parts)
                    parts.append(")")
            parts.append("]")
        elif value is not None or name == "value":
            parts += (name, "=", repr(value), ";")
