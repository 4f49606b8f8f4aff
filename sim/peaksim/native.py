"""The kernels in C: one shared library, called through ctypes, which releases the GIL.

A kernel is declared where it is used, by its prototype in NumPy's words::

    _block_means = function("void block_means(const f4[height,width] image, i8 block, f4[rows,columns] means)")

Types are numbers `i4 i8 f8 …`, `b1`, and arrays of them with the names of their lengths; a length of one name is one
number. `const` arrays are read: they may have another type that NumPy casts to without loss, and any strides. Others
are written, and must be as declared. `?` after the brackets allows None. In C an array is a pointer and, behind it,
those of its lengths that no earlier array has named. A function of type `status` may fail.

`tools/build_native.py` makes the library from `native/*.c`; `pip install` calls it.
"""

import ctypes
import re
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peaksim.native_library import library_folder, open_library

_TYPES: dict[str, tuple[Any, str]] = {
    "b1": (ctypes.c_bool, "bool"),
    "u1": (ctypes.c_uint8, "uint8_t"),
    "i1": (ctypes.c_int8, "int8_t"),
    "u2": (ctypes.c_uint16, "uint16_t"),
    "i2": (ctypes.c_int16, "int16_t"),
    "u4": (ctypes.c_uint32, "uint32_t"),
    "i4": (ctypes.c_int32, "int32_t"),
    "u8": (ctypes.c_uint64, "uint64_t"),
    "i8": (ctypes.c_int64, "int64_t"),
    "f4": (ctypes.c_float, "float"),
    "f8": (ctypes.c_double, "double"),
    "status": (ctypes.c_int32, "status"),
    "void": (None, "void"),
}
_DECLARATION = re.compile(r"(\w+) (\w+)\((.*)\)")
_PARAMETER = re.compile(r"(const )?(\w\d)(?:\[([\w,]+)\](\?)?)? (\w+)")
_FAILURES: dict[int, tuple[type[Exception], str]] = {
    1: (MemoryError, "not enough memory"),
    2: (ValueError, "more items than the kernel has room for"),
}


@cache
def _library() -> ctypes.CDLL:
    return open_library(library_folder())


def address_of(array: NDArray[Any]) -> int:
    """Return where an array's numbers lie: `array.ctypes.data`, which takes ten times as long."""
    if array.size and array.flags.writeable:
        return ctypes.addressof(ctypes.c_char.from_buffer(array.data))
    return array.ctypes.data


class Parameter:
    """One parameter of a kernel, from its declaration."""

    def __init__(self, text: str) -> None:
        match = _PARAMETER.fullmatch(text)
        if match is None or match[2] not in _TYPES:
            raise ValueError(f"a parameter of a kernel: expected e.g. `const f8[n,2] xy` or `i8 count`, got {text!r}")
        self.is_read, self.name = match[1] is not None, match[5]
        self.ctype, self.c_name = _TYPES[match[2]]
        self.lengths = match[3].split(",") if match[3] else []
        self.slots: list[int] = []
        self.may_be_none = match[4] is not None
        self.dtype = np.dtype(match[2])

    def number_lengths(self, names: list[str]) -> None:
        """Find the lengths' places among those of a kernel, and add names that are new."""
        names += [name for name in dict.fromkeys(self.lengths) if name not in names]
        self.slots = [names.index(name) for name in self.lengths]

    def as_array(self, value: Any) -> NDArray[Any]:
        """Return the array that C is given: the value itself, or of a read one a copy of the declared type."""
        if isinstance(value, np.ndarray) and value.dtype == self.dtype:
            flags = value.flags
            if flags.c_contiguous and (self.is_read or flags.writeable):
                return value
            if flags.c_contiguous:
                raise TypeError(f"{self.name}: expected an array that can be written")
        if not self.is_read or not np.can_cast(np.asarray(value).dtype, self.dtype):
            raise TypeError(
                f"{self.name}: expected contiguous {self.dtype}, got {getattr(value, 'dtype', type(value))}"
            )
        return np.ascontiguousarray(value, dtype=self.dtype)

    def as_number(self, value: Any) -> Any:
        """Return the Python number that C is given."""
        if self.ctype is ctypes.c_bool:
            return bool(value)
        return float(value) if self.c_name in ("float", "double") else value.__index__()

    def fix_lengths(self, shape: tuple[int, ...], known: list[int], passed: list[Any]) -> None:
        """Compare a shape with the lengths that are known; pass on those that are not."""
        if len(shape) != len(self.lengths):
            raise TypeError(f"{self.name}: expected {len(self.lengths)} axes, got shape {shape}")
        for slot, length in zip(self.slots, shape, strict=True):
            if slot == len(known):
                known.append(length)
                passed.append(length)
            elif known[slot] != length:
                name = self.lengths[self.slots.index(slot)]
                raise TypeError(
                    f"{self.name}: expected shape ({', '.join(self.lengths)}) with {name} = {known[slot]}, got {shape}"
                )


class Function:
    """A kernel of the library; loaded when first called."""

    def __init__(self, declaration: str) -> None:
        match = _DECLARATION.fullmatch(declaration)
        if match is None or match[1] not in _TYPES:
            raise ValueError(f"a kernel: expected `type name(parameters)`, got {declaration!r}")
        self.result, self.name = match[1], match[2]
        self.parameters = [Parameter(text) for text in match[3].split(", ") if text]
        names = sorted({name for parameter in self.parameters for name in parameter.lengths if name.isdigit()})
        self._numbers = [int(name) for name in names]
        for parameter in self.parameters:
            parameter.number_lengths(names)
        self._call: Callable[..., Any] | None = None

    def __call__(self, *values: Any) -> Any:
        """Call the kernel; TypeError where values are not as declared; a `status` raises too."""
        call = self._call or self._load()
        passed: list[Any] = []
        alive: list[NDArray[Any]] = []
        known = self._numbers.copy()
        for parameter, value in zip(self.parameters, values, strict=True):
            if not parameter.lengths:
                passed.append(parameter.as_number(value))
            elif value is None and parameter.may_be_none:
                passed.append(None)
                shape = tuple(known[slot] if slot < len(known) else 0 for slot in parameter.slots)
                parameter.fix_lengths(shape, known, passed)
            else:
                array = parameter.as_array(value)
                alive.append(array)
                passed.append(address_of(array))
                parameter.fix_lengths(array.shape, known, passed)
        result = call(*passed)
        if self.result == "status" and result:
            kind, reason = _FAILURES[result]
            raise kind(f"{self.name}: {reason}")
        return result

    def prototype(self) -> str:
        """Return the declaration as C has it."""
        parts: list[str] = []
        known: set[str] = set()
        for parameter in self.parameters:
            star = "*" if parameter.lengths else ""
            parts.append(f"{'const ' if parameter.is_read else ''}{parameter.c_name} {star}{parameter.name}")
            for name in parameter.lengths:
                if not name.isdigit() and name not in known:
                    known.add(name)
                    parts.append(f"int64_t {name}")
        return f"{_TYPES[self.result][1]} {self.name}({', '.join(parts) or 'void'})"

    def _load(self) -> Callable[..., Any]:
        call = _library()[self.name]
        call.restype = _TYPES[self.result][0]
        types: list[Any] = []
        known: set[str] = set()
        for parameter in self.parameters:
            types.append(ctypes.c_void_p if parameter.lengths else parameter.ctype)
            new = [name for name in dict.fromkeys(parameter.lengths) if not name.isdigit() and name not in known]
            types += [ctypes.c_int64] * len(new)
            known.update(new)
        call.argtypes = types
        self._call = call
        return call


DECLARED: list[Function] = []
"""Every kernel that a module has declared, so that a test can compare them with the C sources."""


def function(declaration: str) -> Function:
    """Declare a kernel, see the module's head."""
    declared = Function(declaration)
    DECLARED.append(declared)
    return declared
