"""Digests of numbers, arrays, objects, and of the code of functions and classes, to compare sweeps.

The digest of a function covers its bytecode, constants, default values, closure and the globals that it uses, so a
changed function has another digest under the same name. Two runs of one script have the same digest.
"""

from __future__ import annotations

import builtins
import functools
import hashlib
import sys
import types
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

__all__ = ["digest"]

_FIXED = frozenset({"numpy", "receptance", "scipy", *sys.stdlib_module_names})
"""Packages whose functions are identified by their names."""
_INSTALLED = ("/site-packages/", "/dist-packages/")
_NO_CODE = frozenset(
    {"__annotations__", "__dict__", "__doc__", "__firstlineno__", "__module__", "__qualname__", "__slots__",
     "__static_attributes__", "__weakref__", "_abc_impl", "__abstractmethods__", "__annotate_func__",
     "__annotations_cache__", "__dataclass_fields__", "__dataclass_params__", "__match_args__", "__parameters__"}
)  # fmt: skip
"""Attributes of a class that are neither code nor values."""
_BY_NAME = (
    types.BuiltinFunctionType, types.MethodDescriptorType, types.WrapperDescriptorType, types.MethodWrapperType,
    types.GetSetDescriptorType, types.MemberDescriptorType, types.ClassMethodDescriptorType, np.ufunc,
)  # fmt: skip
_PLAIN = (type(None), bool, int, float, complex, str, bytes, type(Ellipsis), type(NotImplemented))


def digest(what: Any) -> str:
    """Return a digest of a value, an object, a function or nested lists and mappings of them.

    Raises
    ------
    TypeError
        An object without comparable content, such as an open file or a lock.
    """
    found = _Digest()
    try:
        found.add(what)
    except RecursionError:
        raise TypeError("its values are nested too deeply to be compared with another run") from None
    return found.sha.hexdigest()[:16]


class _Digest:
    def __init__(self) -> None:
        self.sha = hashlib.sha256()
        self._code: dict[int, Any] = {}
        """Functions, classes and modules that were included; each is included once."""
        self._open: list[int] = []
        """Objects that are being included, to end recursion of an object that contains itself."""

    def _add_text(self, text: str) -> None:
        self.sha.update(f"{len(text)}:{text};".encode("utf-8", "surrogatepass"))

    def add(self, what: Any) -> None:
        kind = type(what)
        if kind in _PLAIN:
            self._add_text(f"{kind.__name__}:{what!r}")
        elif isinstance(what, (types.FunctionType, type, types.ModuleType)):
            self._add_once(what)
        elif id(what) in self._open:
            self._add_text(f"again {len(self._open) - self._open.index(id(what))}")
        else:
            self._open.append(id(what))
            self._add_parts(what)
            self._open.pop()

    def _add_once(self, what: Any) -> None:
        if id(what) in self._code:
            self._add_text(f"again {list(self._code).index(id(what))}")
            return
        self._code[id(what)] = what
        module = what.__name__ if isinstance(what, types.ModuleType) else what.__module__
        version = _fixed(module)
        if version is not None or isinstance(what, types.ModuleType):
            # The members of a user's module that a function uses are included with the function.
            self._add_text(f"{module}.{getattr(what, '__qualname__', '')} {version}")
        elif isinstance(what, type):
            self._add_text("class")
            members = {name: value for name, value in vars(what).items() if name not in _NO_CODE}
            self.add([what.__bases__, members])
        else:
            self._add_text("function")
            self.add([what.__code__, what.__defaults__, what.__kwdefaults__])
            for cell in what.__closure__ or ():
                self._add_cell(cell)
            for name, value in _globals_used(what):
                self.add([name, value])

    def _add_cell(self, cell: Any) -> None:
        try:
            self.add(cell.cell_contents)
        except ValueError:
            self._add_text("empty cell")

    def _add_parts(self, what: Any) -> None:
        if type(what) is np.ndarray and not what.dtype.hasobject:
            self._add_text(f"{what.dtype.str}{what.shape}")
            self.sha.update(np.ascontiguousarray(what).tobytes())
        elif isinstance(what, np.generic):
            self.add(what.item() if not isinstance(what, (np.longdouble, np.clongdouble)) else repr(what))
        elif type(what) in (dict, types.MappingProxyType):
            self._add_text(f"mapping {len(what)}")
            for key, value in what.items():
                self.add(key)
                self.add(value)
        elif type(what) in (list, tuple):
            self._add_text(f"list {len(what)}")
            for one in what:
                self.add(one)
        elif type(what) in (set, frozenset):
            self._add_text(f"set {sorted(map(digest, what))}")
        elif isinstance(what, types.CodeType):
            self._add_text(
                f"code {what.co_argcount} {what.co_posonlyargcount} {what.co_kwonlyargcount} {what.co_flags}"
            )
            self.add([what.co_code, what.co_consts, what.co_names, what.co_exceptiontable])
        elif isinstance(what, types.MethodType):
            self.add([what.__func__, what.__self__])
        elif isinstance(what, types.BuiltinMethodType) and not isinstance(
            what.__self__, (types.ModuleType, type(None))
        ):
            self.add([what.__name__, what.__self__])
        elif isinstance(what, _BY_NAME):
            self._add_text(f"{getattr(what, '__module__', '')}.{getattr(what, '__qualname__', what.__name__)}")
        elif isinstance(what, property):
            self.add([what.fget, what.fset, what.fdel])
        elif isinstance(what, functools.cached_property):
            self.add(what.func)
        elif isinstance(what, (staticmethod, classmethod)):
            self.add(what.__func__)
        elif callable(inner := getattr(what, "__wrapped__", None) or getattr(what, "py_func", None)):
            # A wrapper of a function: a cache, or a compiled function.
            self.add([type(what).__qualname__, inner])
        else:
            self._add_reduced(what)

    def _add_reduced(self, what: Any) -> None:
        """Include an object by the values from which it is pickled."""
        try:
            reduced = what.__reduce_ex__(4)
        except Exception as error:
            raise TypeError(f"{what!r} has no content that can be compared with another run") from error
        if isinstance(reduced, str):
            self._add_text(f"{getattr(what, '__module__', '')}.{reduced}")
            return
        self.add(list(reduced[:3]))
        for items in reduced[3:5]:
            self.add(None if items is None else list(items))


def _fixed(module: str | None) -> str | None:
    """Return the version of an installed package, "" for this program and its libraries, None for code of the user."""
    root = str(module).partition(".")[0]
    if root in _FIXED:
        return ""
    found = sys.modules.get(root)
    # A script is the user's code, also one that an installed program such as pytest runs.
    if root != "__main__" and any(
        place in (getattr(found, "__file__", None) or "").replace("\\", "/") for place in _INSTALLED
    ):
        return str(getattr(found, "__version__", "installed"))
    return None


def _globals_used(function: types.FunctionType) -> Iterator[tuple[str, Any]]:
    """Yield names and values of the globals that a function uses, including members of the user's modules."""
    names = set(_names(function.__code__))
    known = function.__globals__
    for name in sorted(names & known.keys()):
        if known[name] is not getattr(builtins, name, known):
            yield name, known[name]
            yield from _of_module(name, known[name], names)


def _of_module(path: str, value: Any, names: set[str]) -> Iterator[tuple[str, Any]]:
    if isinstance(value, types.ModuleType) and _fixed(value.__name__) is None:
        own: Mapping[str, Any] = vars(value)
        for name in sorted(names & own.keys()):
            inner = own[name]
            yield f"{path}.{name}", inner
            if isinstance(inner, types.ModuleType) and inner.__name__.startswith(f"{value.__name__}."):
                yield from _of_module(f"{path}.{name}", inner, names)


def _names(code: types.CodeType) -> Iterator[str]:
    """Yield the names of globals and attributes that the code and its inner functions look up."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)
