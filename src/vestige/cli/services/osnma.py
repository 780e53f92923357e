"""`vestige osnma`: verify OSNMA messages and extract their keys."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vestige.cli.options import PATH, check_trust, json_option, time_option
from vestige.cli.terminal import echo
from vestige.output import check_output

if TYPE_CHECKING:
    from vestige.crypto.osnma.osnma_report import OsnmaReport
    from vestige.recording.observations.sbf import SbfCounts
    from vestige.time import GalileoTime
    from vestige.validated_key import ValidatedKey

_PROBLEMS_SHOWN = 12


@click.group()
def command() -> None:
    """Verify OSNMA messages and extract validated keys."""


@command.command(name="verify")
@click.argument("file", type=PATH)
@click.option("--public-key", type=PATH, help="OSNMA public key: XML of the GSC, or PEM.")
@click.option("--merkle-tree", type=PATH, help="OSNMA Merkle tree, XML of the GSC; its root is trusted.")
@click.option(
    "-o", "--output", type=click.Path(path_type=Path, dir_okay=False), help="CSV file for the validated keys."
)
@click.option("--fill-gaps", is_flag=True, help="Write the keys of lost subframes too: they follow from later keys.")
@click.option(
    "--start",
    callback=time_option,
    metavar="TIME",
    help="Start time of a test-vector CSV. [default: from its navigation data]",
)
@json_option
def verify_command(
    file: Path, public_key: Path | None, merkle_tree: Path | None, output: Path | None, fill_gaps: bool,
    start: GalileoTime | None, as_json: bool,
) -> None:  # fmt: skip
    """Verify the OSNMA messages in FILE (Septentrio SBF or official test-vector CSV).

    The command verifies the public key against the Merkle tree, and the root key against the public key. Every key is
    verified against the root key, and MACSEQ and tags are verified against the keys. With a public key alone, you vouch
    for that key. With a Merkle tree alone, the public keys in the tree are used. A newer public key in the messages is
    used if it leads to the root of the Merkle tree. The exit code is 1 if a root key or a key does not verify, or if no
    key is validated. With -o, all validated keys are written even if the exit code is 1.
    """
    import json

    from vestige.crypto.keys.key_file import write_key_file
    from vestige.crypto.keys.public_key_file import load_public_keys, read_merkle_tree
    from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
    from vestige.recording.navigation.navigation_pages import read_pages
    from vestige.recording.observations.sbf import SbfCounts

    check_trust(public_key, merkle_tree)
    check_output(output, (file, public_key, merkle_tree))
    public_keys = load_public_keys(public_key, merkle_tree)
    receiver = OsnmaReceiver(public_keys, None if merkle_tree is None else read_merkle_tree(merkle_tree))
    counts = SbfCounts()
    report = receiver.process_all(read_pages(file, start=start, counts=counts))
    keys = receiver.filled_keys() if fill_gaps else report.keys
    if output is not None and keys:
        write_key_file(output, keys, report.verified_roots, report.alerts)
    if as_json:
        described = _describe(report, counts) | {
            "public_keys": [str(key) for key in public_keys],
            "broadcast_public_keys": [str(key) for key in report.broadcast_keys],
        }
        echo(json.dumps(described | {"file": str(file), "keys": [_describe_key(key) for key in keys]}))
    else:
        labels = ["  public key   ", *[" " * 15] * len(public_keys)]
        echo(file, *(f"{label}{key}" for label, key in zip(labels, public_keys, strict=False)))
        echo(*(f"  broadcast    {key}" for key in report.broadcast_keys), *_lines(report, counts))
        if output is not None:
            written = (
                f"{len(keys)} keys written to {output}" if keys else "no file was written, because no key is validated"
            )
            echo(f"  output       {written}")
    report.raise_if_failed()


def _lines(report: OsnmaReport, counts: SbfCounts) -> list[str]:
    """Return the report about the OSNMA messages as lines of text."""
    from collections import Counter

    from vestige.crypto.osnma.messages.subframe import Content

    span = f"{report.first} to {report.last}" if report.first is not None else "none is usable"
    contents = ", ".join(f"{report.subframes.get(content, 0)} {content.value}" for content in Content)
    lines = [
        f"  pages        {report.n_pages} of {len(report.satellites)} satellites, {span}",
        f"               {', '.join(_losses(report, counts)) or 'none lost'}",
        f"  subframes    {contents}; {len(report.osnma_satellites)} satellites with OSNMA",
        f"  time         {report.time_stamps} navigation words agree on it",
    ]
    for check in report.roots:
        verdict = "signature and padding verify" if check.root is not None else f"NOT VERIFIED: {check.reason}"
        known = ", on the chain of an earlier root key" if check.on_known_chain else ""
        lines.append(f"  root key     DSM {check.dsm_id}, header {check.header}: {verdict}{known}")
        if check.kroot is not None:
            of = f"of {check.root.time}, " if check.root is not None else ""
            lines.append(f"               {check.kroot.root_key.hex()} {of}{check.kroot.parameters}")
    if not report.roots:
        lines.append(f"  root key     no complete DSM-KROOT ({report.dsm_progress})")
    lines.append(f"  chain        {report.chain_steps} steps verify")
    if report.keys:
        first, last = report.keys[0], report.keys[-1]
        lines.append(f"  keys         {len(report.keys)} validated, {first.time} to {last.time}")
    if report.withheld:
        reasons = Counter(key.reason for key in report.withheld)
        lines += [f"  WITHHELD     {n} keys: {reason}" for reason, n in reasons.items()]
    lines += [f"  gap          {gap.n_missing} subframes without key after {gap.after}" for gap in report.gaps]
    return lines + _tag_lines(report) + _problem_lines(report)


def _losses(report: OsnmaReport, counts: SbfCounts) -> list[str]:
    """Return a text for each kind of data that was lost or not used, such as pages with a wrong checksum."""
    figures = {
        "with a wrong checksum": report.n_crc_failures,
        "missing in incomplete subframes": report.n_missing_pages,
        "alert pages": report.n_alert_pages,
        **{status.value: n for status, n in report.pages.items() if status.value != "taken"},
        "bad SBF blocks": counts.bad_blocks,
        "bytes between SBF blocks": counts.skipped_bytes,
        "without time": counts.no_time,
        "combined of two signals": counts.mixed,
        "of E5b, not used": counts.e5b,
    }
    return [f"{n} {what}" for what, n in figures.items() if n]


def _tag_lines(report: OsnmaReport) -> list[str]:
    tags = report.tags
    by_adkd = ", ".join(f"ADKD {adkd} {count}" for adkd, count in tags.by_adkd.items()) or "none"
    proven = sorted({data.svid for data in report.navigation if data.adkd == 0 and data.authenticated})
    lines = [
        f"  MACSEQ       {tags.macseq} verify",
        f"  tags         {by_adkd} verify; {tags.dummy} dummies",
        f"               not counted: {tags.no_data} without navigation data, {tags.no_key} without key"
        + (f", {tags.unsupported} of unknown kind" if tags.unsupported else ""),
        *(
            [f"               {tags.data_before} verify with the navigation data before a change"]
            if tags.data_before
            else []
        ),
        f"  navigation   authenticated data of {len(proven)} satellites: "
        + (" ".join(f"E{svid:02d}" for svid in proven) or "none"),
    ]
    if report.n_without_root:
        lines.append(f"  not verified {report.n_without_root} subframes of chains without a root key")
    return lines


def _problem_lines(report: OsnmaReport) -> list[str]:
    lines = [f"  problem      {problem}" for problem in report.problems[:_PROBLEMS_SHOWN]]
    more = len(report.problems) - len(lines)
    return lines + ([f"  problem      … and {more} more (all of them with --json)"] if more else [])


def _describe(report: OsnmaReport, counts: SbfCounts) -> dict[str, Any]:
    """Return the report about the OSNMA messages as values for JSON, without the keys."""
    from dataclasses import asdict

    tags = report.tags
    return {
        "first_page": _describe_time(report.first),
        "last_page": _describe_time(report.last),
        "pages": {
            "given": report.n_pages,
            "crc_failures": report.n_crc_failures,
            "alert": report.n_alert_pages,
            "missing": report.n_missing_pages,
            **{status.value: n for status, n in report.pages.items()},
        },
        "sbf": asdict(counts),
        "subframes": {content.value: n for content, n in report.subframes.items()},
        "satellites": list(report.satellites),
        "osnma_satellites": list(report.osnma_satellites),
        "time_stamps": asdict(report.time_stamps),
        "roots": [
            {
                "dsm_id": check.dsm_id,
                "nma_header": f"{check.header.value:02x}",
                "dsm_kroot": None if check.kroot is None else check.kroot.serialise().hex(),
                "chain_id": None if check.kroot is None else check.kroot.chain_id,
                "pkid": None if check.kroot is None else check.kroot.public_key_id,
                "parameters": None if check.kroot is None else str(check.kroot.parameters),
                "key_hex": None if check.kroot is None else check.kroot.root_key.hex(),
                "received_at": _describe_time(check.received_at),
                "time": None if check.root is None else _describe_time(check.root.time),
                "verified": check.root is not None,
                "on_known_chain": check.on_known_chain,
                "reason": check.reason,
            }
            for check in report.roots
        ],
        "chain_steps": asdict(report.chain_steps),
        "withheld": [
            {"time": _describe_time(key.time), "key_hex": key.data.hex(), "reason": key.reason}
            for key in report.withheld
        ],
        "alerts": [_describe_time(time) for time in report.alerts],
        "gaps": [
            {"after": _describe_time(gap.after), "before": _describe_time(gap.before), "missing": gap.n_missing}
            for gap in report.gaps
        ],
        "macseq": asdict(tags.macseq),
        "tags": {str(adkd): asdict(count) for adkd, count in tags.by_adkd.items()},
        "tags_not_counted": {
            "dummy": tags.dummy, "no_data": tags.no_data, "no_key": tags.no_key, "unsupported": tags.unsupported,
        },
        "tags_of_data_before": tags.data_before,
        "navigation": [
            asdict(data) | {"first": _describe_time(data.first), "last": _describe_time(data.last)}
            for data in report.navigation
        ],
        "subframes_without_root": report.n_without_root,
        "problems": [
            {"kind": problem.kind.value, "time": _describe_time(problem.time), "text": problem.text}
            for problem in report.problems
        ],
        "failures": list(report.failures),
    }  # fmt: skip


def _describe_time(time: GalileoTime | None) -> dict[str, int] | None:
    return None if time is None else {"week": time.week, "second": time.second}


def _describe_key(key: ValidatedKey) -> dict[str, Any]:
    return {
        "chain_id": key.chain_id,
        "time": _describe_time(key.time),
        "key_hex": key.data.hex(),
        "disclosed_at": _describe_time(key.disclosed_at),
        "complete_at": _describe_time(key.complete_at),
    }
