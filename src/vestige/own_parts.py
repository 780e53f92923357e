"""Load detectors, attacks, error models and checks that a user wrote as classes in modules of a folder.

A scenario names a class of the user as `module:Name`. The module is imported only from a folder that the user named
(`--parts FOLDER`, `own_parts_from`). So another person's scenario or stored results cannot make vestige import a module
from any other folder. An exception in a class of the user becomes an `OwnPartError` with a message of one line, unless
the exception is already a `VestigeError`.

The folder with the user's modules comes last in `sys.path`, so these modules never replace a module that vestige or a
library imports. Worker processes have the `sys.path` of the main process, and import the classes of received objects by
name.
"""

from __future__ import annotations

import hashlib
import importlib
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from vestige.errors import VestigeError

DIGITS = 12  # number of hexadecimal digits of a digest
_KIND = re.compile(r"(?P<module>[A-Za-z_]\w*(\.[A-Za-z_]\w*)*):(?P<name>[A-Za-z_]\w*)", re.ASCII)
_folders: list[Path] = []
_digests: dict[str, str] = {}


class OwnPartError(VestigeError):
    """A detector, attack, error model or check that a user wrote cannot be used.

    Parameters
    ----------
    kind
        Name of the user's class in scenarios, `module:Name`.
    found, expected
        Text that says what was found, and text that says what was expected.
    """

    def __init__(self, kind: str, found: str, expected: str) -> None:
        super().__init__(f"{kind}: found {found}, expected {expected}")
        self.kind, self.found, self.expected = kind, found, expected

    def __reduce__(self) -> tuple[type[OwnPartError], tuple[str, str, str]]:
        """Return the class and its arguments for pickle, because a worker process returns its errors pickled."""
        return type(self), (self.kind, self.found, self.expected)


def own_parts_from(folder: Path | str) -> None:
    """Let scenarios name detectors, attacks, error models and checks that a user wrote in the modules of a folder.

    Raises
    ------
    VestigeError
        If the folder does not exist.
    """
    path = Path(folder).resolve()
    if not path.is_dir():
        raise VestigeError(f"{folder}: parts: found no such folder, expected the folder with the modules of your parts")
    if path not in _folders:
        _folders.append(path)
        sys.path.append(str(path))


def is_own(kind: object) -> bool:
    """Return whether `kind` is a string with a colon, like the name `module:Name` of a class that a user wrote."""
    return isinstance(kind, str) and ":" in kind


def kind_of(part: type) -> str:
    """Return the name that a class has in scenarios, `module:Name`."""
    return f"{part.__module__}:{part.__qualname__}"


def part(kind: str, base: type) -> Any:
    """Import and return the class that `kind` names.

    Parameters
    ----------
    kind
        Name of the class in scenarios, `module:Name`.
    base
        Protocol that the class must satisfy, or required base class.

    Raises
    ------
    OwnPartError
        If `kind` does not have the form `module:Name`, if no folder was named, or if the module cannot be imported. If
        the module itself does not define a class with this name, or if the class does not satisfy `base`.
    """
    match = _KIND.fullmatch(kind)
    if match is None:
        raise OwnPartError(kind, "another form", "module:Name, the class Name of the file module.py")
    module = _module(kind, match["module"])
    name = match["name"]
    if not hasattr(module, name):
        raise OwnPartError(kind, f"no {name} in {module.__file__}", "a class of that name")
    found = getattr(module, name)
    if not isinstance(found, type):
        raise OwnPartError(kind, f"{name} in {module.__file__}, which is no class", "a class")
    if kind_of(found) != kind:
        raise OwnPartError(kind, f"a class that {found.__module__} defines", "a class that the module itself defines")
    if not getattr(base, "_is_protocol", False):
        if not issubclass(found, base):
            raise OwnPartError(
                kind, f"a class that is not derived from {base.__name__}", f"{kind_of(base)} as its base"
            )
    else:
        require_members(kind, found, base)
    return found


def made(kind: str, cls: Any, **settings: int) -> Any:
    """Return an object of a class that a user wrote.

    Parameters
    ----------
    kind
        Name of the class in scenarios, `module:Name`.
    cls
        Class of the object.
    settings
        Arguments of the class.

    Raises
    ------
    OwnPartError
        If the object cannot be made with these arguments.
    """
    try:
        with blamed_on_own_parts():
            return cls(**settings)
    except TypeError as error:  # the call itself failed before any line of the user's class
        how = ", ".join(f"{name}={value}" for name, value in settings.items())
        raise OwnPartError(
            kind, f"{type(error).__name__}: {error}", f"a class that {cls.__name__}({how}) makes"
        ) from error


def require_members(kind: str, thing: object, protocol: type) -> None:
    """Raise `OwnPartError` if a class or an object lacks members of a protocol."""
    declared = {name for one in protocol.__mro__ if getattr(one, "_is_protocol", False) for name in _members(one)}
    own = {field.name for field in fields(thing)} if is_dataclass(thing) else set()
    missing = sorted(name for name in declared if name not in own and not hasattr(thing, name))
    if missing:
        raise OwnPartError(
            kind, f"no {', '.join(missing)}", f"the members of {protocol.__module__}.{protocol.__name__}"
        )


def require_numbers(part: object, name: str, values: Any, shape: tuple[int, ...]) -> None:
    """Raise an error if values that a user's class returned are not numbers of the required shape.

    Values that a class of vestige returned are not checked.

    Parameters
    ----------
    part
        Object that returned the values.
    name
        Name of the method that returned the values.
    values, shape
        Returned values, and their required shape, in which the axis of epochs is first.

    Raises
    ------
    OwnPartError
        If the values have another shape, or a value is not a number. Infinities are numbers.
    """
    if type(part).__module__.startswith("vestige."):
        return
    import numpy as np  # noqa: PLC0415  (`vestige --help` needs no numpy)

    kind, found = kind_of(type(part)), np.asarray(values)
    if found.shape != shape or not np.issubdtype(found.dtype, np.number):
        raise OwnPartError(
            kind, f"{found.dtype} values of shape {found.shape} from {name}", f"numbers of shape {shape}"
        )
    if np.isnan(found).any():
        raise OwnPartError(kind, f"NaN among the values of {name}", "numbers")


def digest(kind: str) -> str:
    """Return the first 12 hexadecimal digits of the SHA-256 of a user's module file, with line feeds as line ends.

    The file is read when `part` imports the module, or at the first call if the module was imported otherwise.
    """
    module = kind.partition(":")[0]
    if module not in _digests:
        _digests[module] = _digest(Path(str(sys.modules[module].__file__)))
    return _digests[module]


@contextmanager
def blamed_on_own_parts() -> Iterator[None]:
    """Turn an exception in a module of the user into an `OwnPartError` with file and line.

    A `VestigeError`, and an exception whose traceback has no line in a module of the user, pass unchanged.
    """
    try:
        yield
    except VestigeError:
        raise
    except Exception as error:
        place = _place(error.__traceback__)
        if place is None:
            raise
        path, line, module = place
        what = f"{type(error).__name__}: {error}"
        raise OwnPartError(module, f"line {line} of {path} raises {what}", "no error") from error


def _module(kind: str, name: str) -> Any:
    """Import and return a module from the folders that the user named."""
    if not _folders:
        raise OwnPartError(kind, "no folder of own parts", "--parts FOLDER, the folder of its module")
    stem = Path(*name.split("."))
    files = [folder / one for folder in _folders for one in (stem.with_suffix(".py"), stem / "__init__.py")]
    path = next((one for one in files if one.is_file()), None)
    if path is None:
        raise OwnPartError(kind, f"no {stem}.py in {', '.join(map(str, _folders))}", "the file of the module")
    if name not in sys.modules:
        _digests[name] = _digest(path)
        importlib.invalidate_caches()
    try:
        module = importlib.import_module(name)
    except (Exception, SystemExit) as error:  # a module may raise any exception
        place = _place(error.__traceback__)
        where = f"line {place[1]} of {place[0]}" if place else str(path)
        what = f"{where} raises {type(error).__name__}: {error}"
        raise OwnPartError(kind, what, "a module that can be imported") from error
    if Path(str(getattr(module, "__file__", None))).resolve() != path.resolve():
        raise OwnPartError(kind, f"another module {name} that is already imported", "a name that no other module has")
    return module


def _members(protocol: type) -> set[str]:
    names = set(vars(protocol)) | set(vars(protocol).get("__annotations__", ()))
    return {name for name in names if not name.startswith("_")}


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes().replace(b"\r\n", b"\n")).hexdigest()[:DIGITS]


def _place(traceback: TracebackType | None) -> tuple[Path, int, str] | None:
    """Return file, line and module of the innermost traceback frame that is in a folder of the user, or None."""
    found = None
    while traceback is not None:
        path = Path(traceback.tb_frame.f_code.co_filename)
        if any(folder in path.parents for folder in _folders):
            found = path, traceback.tb_lineno, str(traceback.tb_frame.f_globals.get("__name__"))
        traceback = traceback.tb_next
    return found
