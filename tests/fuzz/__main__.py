"""`make fuzz`: random inputs for every reader; says the seed, and keeps each input that shows something wrong."""

from __future__ import annotations

import argparse
import secrets
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from fuzz.engine import Finding, examine, load, save, shares
from fuzz.targets import TARGETS

FOLDER = Path("build/fuzz")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, print what was found, and return 1 if anything was."""
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, help="default: another one each time, which is printed")
    parser.add_argument("--target", choices=sorted(target.name for target in TARGETS), help="one reader only")
    parser.add_argument("--replay", type=Path, metavar="FILE", help="one input that was kept")
    options = parser.parse_args(arguments)
    if options.replay:
        return _replay(options.replay)
    seed = secrets.randbelow(1 << 32) if options.seed is None else options.seed
    targets = [target for target in TARGETS if options.target in (None, target.name)]
    print(f"{options.inputs} inputs for {len(targets)} readers, seed {seed}", flush=True)
    found: dict[tuple[str, str], tuple[int, Path]] = {}
    for target in targets:
        began_s, n_inputs = time.process_time(), shares(targets, options.inputs)[target.name]
        for number in range(n_inputs):
            finding = examine(target, target.input(seed, number))
            if finding is not None:
                _keep(finding, found)
        print(f"  {target.name:20} {n_inputs:6} inputs {time.process_time() - began_s:7.1f} CPU s", flush=True)
    for (name, kind), (count, path) in found.items():
        print(f"{name}: {kind}: {count} inputs; again: make fuzz REPLAY={path}")
    print(f"{sum(count for count, _ in found.values())} inputs with findings, of {len(found)} kinds")
    return 1 if found else 0


def _keep(finding: Finding, found: dict[tuple[str, str], tuple[int, Path]]) -> None:
    """Count a finding; of each kind the first input is kept."""
    key = finding.target, finding.kind
    count, path = found[key] if key in found else (0, save(finding, FOLDER))
    found[key] = count + 1, path
    if not count:
        print(f"FOUND {finding.target}: {finding.kind}: {path}", flush=True)


def _replay(path: Path) -> int:
    name, files = load(path)
    finding = examine(next(target for target in TARGETS if target.name == name), files)
    print(f"{path}: nothing wrong" if finding is None else f"{finding.kind}\n{finding.detail}")
    return 0 if finding is None else 1


if __name__ == "__main__":
    sys.exit(main())
