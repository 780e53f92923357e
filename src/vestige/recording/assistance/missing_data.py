"""List the data that an assistance folder lacks, group delays of another time, and unverified files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from vestige.constants import DAY_S
from vestige.crypto.recs.file_signature import SignatureStatus
from vestige.recording.assistance.assistance_files import FileKind, FileTrust
from vestige.records import Assistance

if TYPE_CHECKING:
    from vestige.recording.assistance.folder import AssistanceFile

# RECS are published up to a week ahead [WFO, Sec. II-A], together with the group delays. Older group delays are used
# with a warning, because no document says how long a BGD file is valid.
OLDEST_GROUP_DELAY_S = 7 * DAY_S

NO_RECS = "RECS: none"


def missing_data(assistance: Assistance, files: Sequence[AssistanceFile], trust: FileTrust | None) -> tuple[str, ...]:
    """Return lines for the user about the data that the folder lacks.

    A line names a kind of data that the processor can use, a satellite with group delays of another time, or the number
    of files without a verified signature.
    """
    missing = []
    if trust is None:
        missing.append(
            "OSNMA public key or Merkle tree: none, so no key can be validated; give --public-key or --merkle-tree"
        )
    if not assistance.segments:
        missing.append(NO_RECS)
    needed = {segment.key_time for segment in assistance.segments}
    absent = sorted(needed - {key.time for key in assistance.keys})
    if absent:
        first, more = str(absent[0]), len(absent) - 1
        which = f"the key of {first} and {more} more are missing" if more else f"the key of {first} is missing"
        missing.append(
            f"OSNMA keys: {which}, and RECS without their key get no verdict; `vestige osnma verify` writes a key file "
            "from navigation pages"
        )
    elif not assistance.keys:
        missing.append("OSNMA keys: none")
    without = {s.svid for s in assistance.segments} - {delay.svid for delay in assistance.group_delays}
    if without:
        missing.append(f"group delays: none for {', '.join(f'E{svid:02d}' for svid in sorted(without))}; taken as 0")
    missing += _of_another_time(assistance)
    kinds = {file.kind for file in files}
    if FileKind.RECEIVER not in kinds:
        missing.append("receiver.toml: none, so the delay between the front ends is taken as 0")
    if FileKind.IONOSPHERE not in kinds:
        missing.append("ionosphere.csv: none, so no ionospheric delay is predicted")
    unverified = sum(file.signature not in (None, SignatureStatus.VERIFIED) for file in files)
    if unverified:
        missing.append(f"signatures: {unverified} files have no verified signature of the server")
    return tuple(missing)


def _of_another_time(assistance: Assistance) -> Iterator[str]:
    """Yield a line for each satellite whose group delays begin after its last RECS, or are over 7 days older."""
    # latest RECS of each satellite, because the segments are in the order of time
    last = {segment.svid: segment.transmit_time for segment in assistance.segments}
    for svid, sent in sorted(last.items()):
        since = [delay.valid_from for delay in assistance.group_delays if delay.svid == svid]
        ages_s = [sent - one for one in since if one <= sent]
        if since and not ages_s:
            yield f"group delays of E{svid:02d} are valid from {min(since)} on, after its RECS; taken as 0"
        elif ages_s and min(ages_s) > OLDEST_GROUP_DELAY_S:
            yield (
                f"group delays of E{svid:02d} are {min(ages_s) / DAY_S:.0f} days older than its RECS, expected at most "
                f"{OLDEST_GROUP_DELAY_S / DAY_S:g}; get the BGD file that the server gave with these RECS"
            )
