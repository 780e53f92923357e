"""Find the scenario files that come with vestige."""

from __future__ import annotations

from pathlib import Path

import vestige


def shipped_scenarios() -> tuple[Path, ...]:
    """Return the scenario files that come with vestige, in the order of their names.

    An installed package contains the scenario files. In a checkout the scenario files are in the folder `scenarios`.

    Examples
    --------
    >>> [path.name for path in shipped_scenarios()][:2]
    ['first_light.toml', 'harsh.toml']
    """
    package = Path(vestige.__file__).resolve().parent
    folders = (package / "scenarios", package.parents[1] / "scenarios")
    return tuple(sorted(next(folder for folder in folders if folder.is_dir()).glob("*.toml")))
