from __future__ import annotations

from osnma_builder import Broadcast, make_page
from simulated_chain import make_chain
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.crypto.osnma.osnma_receiver import OsnmaReceiver
from vestige.time import GalileoTime

START = GalileoTime(1400, 604_800 - 5 * 30)  # the sixth subframe is in the next week
N = 14
CHAIN = make_chain(
    b"page intake", START, N, chain_id=1, pkid=4, parameters=ChainParameters(mac_lookup=34, alpha=b"sixbyt")
)
PAGES = Broadcast(CHAIN, n_subframes=N).pages()
KEYS = [key.data for key in CHAIN.keys]


def test_a_zero_field_was_not_sent() -> None:
    """OSNMA starts in the middle of subframe 5 of E07 and stops in the middle of its subframe 9, at each page."""
    for number in (0, 12, 14):
        pages = [
            make_page(7, page.time, page.word, bytes(5))
            if page.svid == 7
            and (START + 150 <= page.time < START + (151 + 2 * number) or START + (271 + 2 * number) <= page.time)
            and (page.time < START + 300)
            else page
            for page in PAGES
        ]
        receiver = OsnmaReceiver((CHAIN.public_key,))
        for page in pages:
            receiver.process(page)
        receiver.finish()
        report = receiver.report()
        assert report.failures == ()
        assert report.problems == ()
        assert [key.data for key in report.keys] == KEYS
        (started,) = [one for one in receiver.received() if one.svid == 7 and one.time == START + 150]
        assert [field is None for field in started.fields] == [k < number for k in range(15)]
