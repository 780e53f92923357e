"""The check of array types in a test run: beartype and jaxtyping on the parameters and results that are arrays.

The import hook writes a decorator above every function and dataclass of a module. The decorator of jaxtyping
takes more time than the sample pipeline, so this module has another one. It leaves functions without arrays as they
are: mypy checks them. It makes a check when its function is first called, and checks the arrays alone. Of the calls of
a function in one test it checks the first eight, and then those whose number is a power of two.
"""

from __future__ import annotations

import dataclasses
import functools
import re
import types
from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import Any

import jaxtyping
from beartype import BeartypeConf, beartype
from jaxtyping import config

# int is accepted where float is asked for (PEP 484)
_beartype = beartype(conf=BeartypeConf(is_pep484_tower=True))


# So many first calls of a function are checked in each test, then call 16, 32, 64 … A campaign makes thousands of calls
# that are alike, and what changes with time comes late: the last call that is checked is never before half of all.
CALLS = 8
_tests = 0


def begin_test() -> None:
    """Let the next calls of every function be checked again."""
    global _tests  # noqa: PLW0603
    _tests += 1


def install(modules: Sequence[str]) -> None:
    """Check the arrays of these modules, which must not be imported yet."""
    jaxtyping.jaxtyped = _jaxtyped  # type: ignore[assignment]  # the name that the import hook writes
    jaxtyping.install_import_hook(modules, "strict_types.check")


def check(definition: Any) -> Any:
    """Return a function, or a dataclass, that checks the arrays that it is given and that it returns."""
    if isinstance(definition, type):
        if dataclasses.is_dataclass(definition) and "__init__" in vars(definition):
            definition.__init__ = check(definition.__init__)  # type: ignore[misc]
        return definition
    arrays = [name for name in definition.__annotations__ if _is_array(definition, name)]
    return _checked(definition, arrays) if arrays else definition


def _jaxtyped(*, typechecker: object) -> Callable[[Any], Any]:
    return check


def _is_array(function: Callable[..., Any], name: str) -> bool:
    """Tell whether the annotation of a parameter, or of `return`, has an array or the name of a type that has one."""
    annotation = function.__annotations__[name]
    text = annotation if isinstance(annotation, str) else repr(annotation)
    aliases = (function.__globals__.get(word) for word in re.findall(r"\w+", text))
    return "ndarray" in text or any(
        not isinstance(alias, type | types.ModuleType | types.FunctionType)
        and "ndarray" in f"{alias!r} {getattr(alias, '__constraints__', ())!r}"
        for alias in aliases
    )


class _Calls:
    """How often the code of a function was called in the present test."""

    __slots__ = ("number", "test")

    def __init__(self) -> None:
        self.test = self.number = 0


# By code, not by function: a function within a function is a new one at each call of the outer one, and to make the
# check of one takes a millisecond.
_CALLS: defaultdict[types.CodeType, _Calls] = defaultdict(_Calls)


def _checked(function: Callable[..., Any], arrays: Sequence[str]) -> Callable[..., Any]:
    strict: Callable[..., Any] | None = None
    calls = _CALLS[function.__code__]

    @functools.wraps(function)
    def wrapper(*arguments: Any, **named: Any) -> Any:
        nonlocal strict
        # written out here, because functions are called a million times in a minute of tests
        if calls.test != _tests:
            calls.test, calls.number = _tests, 0
        calls.number = number = calls.number + 1
        if (number > CALLS and number & (number - 1)) or config.jaxtyping_disable:
            return function(*arguments, **named)
        if strict is None:
            strict = _beartype(_with_arrays_alone(function, arrays))
        with _CONTEXT:  # an axis "n" has one length in all arguments and in the result
            return strict(*arguments, **named)

    return wrapper


def _with_arrays_alone(function: Any, arrays: Sequence[str]) -> Any:
    """Return the same function, annotated with nothing but its arrays."""
    copy = types.FunctionType(
        function.__code__, function.__globals__, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__kwdefaults__, copy.__qualname__ = function.__kwdefaults__, function.__qualname__
    copy.__annotations__ = {}
    for name in arrays:
        annotation = function.__annotations__[name]
        try:
            resolved = eval(annotation, function.__globals__) if isinstance(annotation, str) else annotation  # noqa: S307
        except NameError:  # a name that is imported for mypy alone
            continue
        copy.__annotations__[name] = resolved
    return copy


_CONTEXT = jaxtyping.jaxtyped("context")
