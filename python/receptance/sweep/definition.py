"""Definition of a sweep (models, candidates, outputs), its digest, and the evaluation of its blocks."""

from __future__ import annotations

import builtins
import functools
import hashlib
import sys
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.identification.unknowns import covered
from receptance.model.assembly import Assembly
from receptance.sweep.candidates import Candidates
from receptance.sweep.disk import SweepError
from receptance.sweep.outputs import Output, Variable

if TYPE_CHECKING:
    from receptance.campaign import Campaign

    Model = Assembly | Mapping[str, Assembly] | Campaign

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


def digest(item: Any) -> str:
    """Return a digest of a value, an object, a function or nested lists and mappings of them.

    That of a function covers its bytecode, constants, default values, closure and the globals that it uses, so a
    changed function has another digest under the same name. Two runs of one script have the same digest. An object
    without comparable content, such as an open file or a lock, raises a TypeError.
    """
    result = _Digest()
    try:
        result.add(item)
    except RecursionError:
        raise TypeError("its values are nested too deeply to be compared with another run") from None
    return result.sha.hexdigest()[:16]


class _Digest:
    """Digest of nested items; each function, class and module is included once."""

    def __init__(self) -> None:
        self.sha = hashlib.sha256()
        self._code: dict[int, Any] = {}
        """Functions, classes and modules that were included."""
        self._open: list[int] = []
        """Objects that are being included, to end recursion of an object that contains itself."""

    def _add_text(self, text: str) -> None:
        self.sha.update(f"{len(text)}:{text};".encode("utf-8", "surrogatepass"))

    def add(self, item: Any) -> None:
        kind = type(item)
        if kind in _PLAIN:
            self._add_text(f"{kind.__name__}:{item!r}")
        elif isinstance(item, (types.FunctionType, type, types.ModuleType)):
            self._add_once(item)
        elif id(item) in self._open:
            self._add_text(f"again {len(self._open) - self._open.index(id(item))}")
        else:
            self._open.append(id(item))
            self._add_parts(item)
            self._open.pop()

    def _add_once(self, item: Any) -> None:
        if id(item) in self._code:
            self._add_text(f"again {list(self._code).index(id(item))}")
            return
        self._code[id(item)] = item
        module = item.__name__ if isinstance(item, types.ModuleType) else item.__module__
        version = _fixed(module)
        if version is not None or isinstance(item, types.ModuleType):
            # The members of a user's module that a function uses are included with the function.
            self._add_text(f"{module}.{getattr(item, '__qualname__', '')} {version}")
        elif isinstance(item, type):
            self._add_text("class")
            members = {name: value for name, value in vars(item).items() if name not in _NO_CODE}
            self.add([item.__bases__, members])
        else:
            self._add_text("function")
            self.add([item.__code__, item.__defaults__, item.__kwdefaults__])
            for cell in item.__closure__ or ():
                self._add_cell(cell)
            for name, value in _globals_used(item):
                self.add([name, value])

    def _add_cell(self, cell: Any) -> None:
        try:
            self.add(cell.cell_contents)
        except ValueError:
            self._add_text("empty cell")

    def _add_parts(self, item: Any) -> None:
        if type(item) is np.ndarray and not item.dtype.hasobject:
            self._add_text(f"{item.dtype.str}{item.shape}")
            self.sha.update(np.ascontiguousarray(item).tobytes())
        elif isinstance(item, np.generic):
            self.add(item.item() if not isinstance(item, (np.longdouble, np.clongdouble)) else repr(item))
        elif type(item) in (dict, types.MappingProxyType):
            self._add_text(f"mapping {len(item)}")
            for key, value in item.items():
                self.add(key)
                self.add(value)
        elif type(item) in (list, tuple):
            self._add_text(f"list {len(item)}")
            for element in item:
                self.add(element)
        elif type(item) in (set, frozenset):
            self._add_text(f"set {sorted(map(digest, item))}")
        elif isinstance(item, types.CodeType):
            self._add_text(
                f"code {item.co_argcount} {item.co_posonlyargcount} {item.co_kwonlyargcount} {item.co_flags}"
            )
            self.add([item.co_code, item.co_consts, item.co_names, item.co_exceptiontable])
        elif isinstance(item, types.MethodType):
            self.add([item.__func__, item.__self__])
        elif isinstance(item, types.BuiltinMethodType) and not isinstance(
            item.__self__, (types.ModuleType, type(None))
        ):
            self.add([item.__name__, item.__self__])
        elif isinstance(item, _BY_NAME):
            self._add_text(f"{getattr(item, '__module__', '')}.{getattr(item, '__qualname__', item.__name__)}")
        elif isinstance(item, property):
            self.add([item.fget, item.fset, item.fdel])
        elif isinstance(item, functools.cached_property):
            self.add(item.func)
        elif isinstance(item, (staticmethod, classmethod)):
            self.add(item.__func__)
        elif callable(inner := getattr(item, "__wrapped__", None) or getattr(item, "py_func", None)):
            # A wrapper of a function: a cache, or a compiled function.
            self.add([type(item).__qualname__, inner])
        else:
            self._add_reduced(item)

    def _add_reduced(self, item: Any) -> None:
        """Include an object by the values from which it is pickled."""
        try:
            reduced = item.__reduce_ex__(4)
        except Exception as error:
            raise TypeError(f"{item!r} has no content that can be compared with another run") from error
        if isinstance(reduced, str):
            self._add_text(f"{getattr(item, '__module__', '')}.{reduced}")
            return
        self.add(list(reduced[:3]))
        for items in reduced[3:5]:
            self.add(None if items is None else list(items))


def _fixed(module: str | None) -> str | None:
    """Return the version of an installed package, "" for this program and its libraries, None for code of the user."""
    root = str(module).partition(".")[0]
    if root in _FIXED:
        return ""
    package = sys.modules.get(root)
    file = (getattr(package, "__file__", None) or "").replace("\\", "/")
    # A script is the user's code, also one that an installed program such as pytest runs.
    if root != "__main__" and any(folder in file for folder in _INSTALLED):
        return str(getattr(package, "__version__", "installed"))
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
        members: Mapping[str, Any] = vars(value)
        for name in sorted(names & members.keys()):
            inner = members[name]
            yield f"{path}.{name}", inner
            if isinstance(inner, types.ModuleType) and inner.__name__.startswith(f"{value.__name__}."):
                yield from _of_module(f"{path}.{name}", inner, names)


def _names(code: types.CodeType) -> Iterator[str]:
    """Yield the names of globals and attributes that the code and its inner functions look up."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)


CANDIDATE = "candidate"
VALID = "valid"
"""Name of the variable that marks feasible candidates."""
_ASSEMBLY = "assembly"
_BLOCK_BYTES, _BLOCK_S = 4e6, 0.25
"""Default size of the results of a block in bytes and largest duration of its evaluation in s."""
_FEWEST, _MOST = 16, 16384
"""Bounds of the number of candidates in a block: progress needs small blocks, low overhead large ones."""

Block = Callable[[int, int], dict[str, "NDArray[Any]"]]


@dataclass(frozen=True, eq=False)
class Definition:
    """Models, candidates and outputs of a sweep.

    The results have a dimension `assembly` if the assemblies are named.
    """

    assemblies: dict[str, Assembly]
    named: bool
    candidates: Candidates
    outputs: tuple[Output, ...]

    @classmethod
    def of(
        cls,
        model: Assembly | Mapping[str, Assembly] | Campaign,
        candidates: Candidates,
        outputs: Output | Sequence[Output],
    ) -> Definition:
        """Return the definition from checked arguments of `sweep`."""
        assemblies, named = _assemblies(model)
        if not isinstance(candidates, Candidates):
            raise TypeError(f"sweep: candidates is {candidates!r}, expected Grid, Listed or Sampled")
        kind: Any = Output
        checked = _checks.items("sweep: outputs", outputs, kind, text="Output such as Misfit(...)")
        definition = cls(assemblies, named, candidates, checked)
        definition._check_addresses()
        definition._check_names()
        return definition

    def _check_addresses(self) -> None:
        assemblies = [assembly for output in self.outputs for assembly in output.assemblies()]
        if any(output.per_assembly for output in self.outputs):
            assemblies += list(self.assemblies.values())
        for address in self.candidates.addresses:
            if not any(covered(address, assembly) for assembly in assemblies):
                known = ", ".join(sorted({name for assembly in assemblies for name in assembly.parameters}))
                raise ValueError(f"sweep: no assembly has the parameter {address!r}, expected one of {known}")

    def _check_names(self) -> None:
        names = [variable.name for output in self.outputs for variable in output.variables()]
        names += [*self.candidates.addresses, VALID, CANDIDATE, _ASSEMBLY]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ValueError(f"sweep: {', '.join(repeated)} occurs twice; give outputs different names")

    def variables(self) -> list[Variable]:
        """Return the variables of the results, with the dimension `assembly` if there is one."""
        known: dict[str, NDArray[Any]] = {}
        variables = []
        for output in self.outputs:
            for variable in output.variables():
                dimensions: dict[str, NDArray[Any]] = {}
                if self.named and output.per_assembly:
                    dimensions[_ASSEMBLY] = np.array(list(self.assemblies))
                for name, values in variable.dimensions.items():
                    # Another output may have this dimension with other values.
                    same = name not in known or np.array_equal(known[name], values)
                    dimensions[name if same else f"{variable.name}_{name}"] = values
                known |= dimensions
                variables.append(replace(variable, dimensions=dimensions))
        return variables

    def block_size(self) -> int:
        """Return the default number of candidates in a block."""
        bytes_each = max(np.dtype(v.dtype).itemsize * max(int(np.prod(v.shape)), 1) for v in self.variables())
        seconds_each = sum(o.candidate_s * (len(self.assemblies) if o.per_assembly else 1) for o in self.outputs)
        return int(min(max(min(_BLOCK_BYTES / bytes_each, _BLOCK_S / max(seconds_each, 1e-9)), _FEWEST), _MOST))

    def prepare(self, threads: int | None) -> Block:
        """Return the function from a range of candidates to their results; shared terms are evaluated here."""
        addresses = self.candidates.addresses
        runs = []
        for output in self.outputs:
            models: Sequence[Assembly | None] = list(self.assemblies.values()) if output.per_assembly else [None]
            runs.append((output, [output.prepare(model, addresses, threads) for model in models]))

        def block(start: int, stop: int) -> dict[str, NDArray[Any]]:
            values = self.candidates.values(start, stop)
            results: dict[str, NDArray[Any]] = {name: values[:, i].copy() for i, name in enumerate(addresses)}
            valid = np.ones(stop - start, dtype=np.bool_)
            for output, evaluations in runs:
                arrays, feasible = zip(*(evaluate(values) for evaluate in evaluations), strict=True)
                valid &= np.logical_and.reduce(feasible)
                stacked = self.named and output.per_assembly
                for name, first in arrays[0].items():
                    results[name] = np.stack([array[name] for array in arrays], axis=1) if stacked else first
            results[VALID] = valid
            return results

        return block

    def fingerprints(self) -> dict[str, str]:
        """Return digests of models, candidates and outputs, which identify the sweep.

        Functions and outputs of the user with an object without comparable content, such as a lock, raise a SweepError.
        """
        models = [[name, *_content(assembly)] for name, assembly in self.assemblies.items()]
        contents: dict[str, Any] = {
            "model": models,
            # The code of a user's class is part of its content.
            "candidates": [type(self.candidates), self.candidates.describe()],
        }
        for output in self.outputs:
            content = [type(output), output.describe(), [_content(assembly) for assembly in output.assemblies()]]
            contents |= {f"output {variable.name}": [*content, variable.unit] for variable in output.variables()}
        digests = {}
        for name, content in contents.items():
            try:
                digests[name] = digest(content)
            except TypeError as error:
                raise SweepError(
                    f"sweep: {name}: {error}, so a store cannot be compared with a later run; use functions that refer "
                    "to numbers, text, arrays and other functions only, or sweep without a store"
                ) from error
        return digests


def _assemblies(model: object) -> tuple[dict[str, Assembly], bool]:
    if isinstance(model, Assembly):
        return {"": model}, False
    named = model if isinstance(model, Mapping) else getattr(model, "assemblies", None)
    if not isinstance(named, Mapping) or not named or not all(isinstance(item, Assembly) for item in named.values()):
        raise TypeError(f"sweep: model is {model!r}, expected an Assembly, several by name, or a campaign")
    return {str(name): assembly for name, assembly in named.items()}, True


def _content(assembly: Assembly) -> list[Any]:
    """Return the values and types of an assembly."""
    elements = {**assembly.elements, **assembly.attachments}
    values = [[address, assembly.get(address)] for address in assembly.parameters]
    flat = assembly.flat()
    kinds = {name: type(element).__name__ for name, element in elements.items()}
    tables = [array for _, part in flat.tabled for array in (part.frequency_hz, part.matrix)]
    return [assembly.motion, kinds, values, *flat.tables, *tables]
