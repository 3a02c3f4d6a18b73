"""Definition of a sweep (models, candidates, outputs), its fingerprints, and the evaluation of its blocks."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.fit.unknowns import covered
from receptance.model.assembly import Assembly
from receptance.sweep.candidates import Candidates
from receptance.sweep.outputs import PROGRAM, Output, Reduction, Variable

CANDIDATE = "candidate"
VALID = "valid"
"""Name of the variable that marks feasible candidates."""
_ASSEMBLY = "assembly"
_BLOCK_BYTES, _BLOCK_S = 16e6, 0.5
"""Default size of the results of a block in bytes and largest duration of its evaluation in s."""
_FEWEST, _MOST = 16, 65536
"""Bounds of the number of candidates in a block: progress needs small blocks; a store needs some milliseconds each."""


class SweepError(ValueError):
    """An unsuitable or damaged store, or results that do not fit into memory."""


Block = Callable[[int, int], dict[str, "NDArray[Any]"]]


class Definition:
    """Models, candidates and outputs of a sweep, which are the arguments of `sweep` and are checked.

    The results have a dimension `assembly` if the assemblies are `named`.
    """

    def __init__(
        self, model: Assembly | Mapping[str, Assembly], candidates: Candidates, outputs: Output | Sequence[Output]
    ) -> None:
        self.assemblies, self.named = _assemblies(model)
        if not isinstance(candidates, Candidates):
            raise TypeError(f"sweep: candidates is {candidates!r}, expected Grid, Listed or Sampled")
        self.candidates = candidates
        kind: Any = Output
        self.outputs: tuple[Output, ...] = _checks.items(
            "sweep: outputs", outputs, kind, text="Output such as Misfit(...)"
        )
        self._check_addresses()
        self._check_names()

    def _check_addresses(self) -> None:
        assemblies = [assembly for output in self.outputs for assembly in output.assemblies()]
        if any(output.per_assembly for output in self.outputs):
            assemblies += list(self.assemblies.values())
        for address in self.candidates.addresses:
            if not any(covered(address, assembly) for assembly in assemblies):
                parameters = ", ".join(sorted({name for assembly in assemblies for name in assembly.parameters}))
                raise ValueError(f"sweep: no assembly has the parameter {address!r}, expected one of {parameters}")

    def _check_names(self) -> None:
        names = [variable.name for output in self.outputs for variable in output.variables()]
        names += [*self.candidates.addresses, VALID, CANDIDATE, _ASSEMBLY]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ValueError(f"sweep: {', '.join(repeated)} occurs twice; give outputs different names")

    def variables(self) -> list[Variable]:
        """Return the variables of the results, with the dimension `assembly` if there is one."""
        coordinates: dict[str, NDArray[Any]] = {}
        variables = []
        for output in self.outputs:
            for variable in output.variables():
                dimensions: dict[str, NDArray[Any]] = {}
                if self.named and output.per_assembly:
                    dimensions[_ASSEMBLY] = np.array(list(self.assemblies))
                for name, values in variable.dimensions.items():
                    # Another output may have this dimension with other values.
                    same = name not in coordinates or np.array_equal(coordinates[name], values)
                    dimensions[name if same else f"{variable.name}_{name}"] = values
                coordinates |= dimensions
                variables.append(replace(variable, dimensions=dimensions))
        return variables

    def kept(self) -> list[Variable]:
        """Return all that is kept of a candidate: its parameters, the results, and whether it is feasible."""
        parameters = [Variable(address, "float64", "") for address in self.candidates.addresses]
        return [*parameters, *self.variables(), Variable(VALID, "bool", "")]

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
        """Return digests of the values of models, candidates and outputs, which identify the sweep."""
        contents: dict[str, Any] = {
            "model": [[name, *_content(assembly)] for name, assembly in self.assemblies.items()],
            "candidates": [type(self.candidates).__name__, self.candidates.describe()],
        }
        for output in self.outputs:
            content = [type(output).__name__, output.version, output.describe()]
            content.append([_content(assembly) for assembly in output.assemblies()])
            contents |= {f"output {variable.name}": [*content, variable.unit] for variable in output.variables()}
        return {name: _digest(name, content) for name, content in contents.items()}

    def code(self) -> dict[str, str]:
        """Return names and versions of code that is not part of the program, by the outputs that it evaluates."""
        code: dict[str, str] = {}
        for output in self.outputs:
            named = [str(item) for item in output.describe() if isinstance(item, Reduction)]
            if output.version != PROGRAM:
                named.insert(0, f"{type(output).__name__}, version {output.version}")
            if named:
                code |= {f"output {variable.name}": "; ".join(named) for variable in output.variables()}
        return code


def _digest(name: str, content: Any) -> str:
    try:
        text = json.dumps(_plain(content))
    except TypeError as error:
        raise SweepError(
            f"sweep: {name}: {error}, expected numbers, text, arrays, and lists and mappings of them; a function is "
            "described by Reduction(function, name=..., version=...)"
        ) from None
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _plain(item: Any) -> Any:
    """Return a value as JSON has it; two values are written alike only if they are equal."""
    if isinstance(item, (type(None), bool, int, float, str)):
        return item
    if isinstance(item, complex):
        return ["complex", item.real, item.imag]
    if isinstance(item, np.generic):
        return _plain(item.item())
    if isinstance(item, np.ndarray) and item.dtype.kind in "biufc":
        return [item.dtype.str, item.shape, hashlib.sha256(np.ascontiguousarray(item).tobytes()).hexdigest()]
    if isinstance(item, Reduction):
        return ["reduction", item.name, item.version]
    if isinstance(item, Mapping):
        return ["mapping", *([_plain(key), _plain(value)] for key, value in item.items())]
    if isinstance(item, (list, tuple)):
        return ["list", *map(_plain, item)]
    raise TypeError(f"{item!r} cannot be compared with another run")


def _assemblies(model: object) -> tuple[dict[str, Assembly], bool]:
    if isinstance(model, Assembly):
        return {"": model}, False
    if not isinstance(model, Mapping) or not model or not all(isinstance(item, Assembly) for item in model.values()):
        raise TypeError(
            f"sweep: model is {model!r}, expected an Assembly or several by name, such as `campaign.assemblies`"
        )
    return {str(name): assembly for name, assembly in model.items()}, True


def _content(assembly: Assembly) -> list[Any]:
    """Return the values and types of an assembly."""
    elements = {**assembly.elements, **assembly.attachments}
    values = [[address, assembly.get(address)] for address in assembly.parameters]
    flat = assembly.flat()
    kinds = {name: type(element).__name__ for name, element in elements.items()}
    tables = [array for _, part in flat.tabled for array in (part.frequency_hz, part.matrix)]
    return [assembly.motion, kinds, values, *flat.tables, *tables]
