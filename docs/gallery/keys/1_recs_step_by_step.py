"""
Decrypt a RECS step by step
===========================

Use this example to write a reader of RECS of your own, or to check your reader. The script encrypts 1 ms of E6-C
chips as the server does. The script then decrypts the chips with hashlib and cryptography only, and shows the result
of a wrong key.
"""

# %%
# The server knows the chips that will be on air, and a key that is still secret.
import hashlib

import matplotlib.pyplot as plt
import numpy as np
from cryptography.hazmat.primitives.ciphers import Cipher
from cryptography.hazmat.primitives.ciphers.algorithms import AES
from cryptography.hazmat.primitives.ciphers.modes import CBC

import vestige as vs
from vestige.crypto.recs.recs_segment import encrypt
from vestige.records import ChipSequence
from vestige.signals.codes import primary_code
from vestige.signals.definitions import E6C

sent = vs.GalileoTime.parse("2026-11-21T12:00:16 GST")
chips = primary_code(E6C, 11)  # 5115 open chips, in place of encrypted chips
secret = bytes(range(16))
segment = encrypt(
    ChipSequence.of(svid=11, transmit_time=sent, chip_rate_hz=E6C.chip_rate_hz, chips=chips), secret, key_delay=1
)
print(f"{len(segment.cipher)} bytes, key of {segment.key_time}")

# %%
# **1. The AES key** is the SHA-256 of the OSNMA key. **2. The initialization vector** is the first 16 bytes of
# the SHA-256 of the time of the key's subframe, the random offset and 11 zero bytes. **3. AES-256 in CBC mode** gives
# the chips as bits. The bit 0 is the chip +1.
wrapped = hashlib.sha256(secret).digest()
word = (segment.key_time.week % 4096) << 20 | segment.key_time.second
vector = hashlib.sha256(word.to_bytes(4, "big") + bytes([segment.random_offset]) + bytes(11)).digest()[:16]


def decrypted(aes_key):
    """Return the chips that a key gives."""
    context = Cipher(AES(aes_key), CBC(vector)).decryptor()
    packed = context.update(segment.cipher) + context.finalize()
    return 1 - 2 * np.unpackbits(np.frombuffer(packed, np.uint8))[: chips.size].astype(int)


print("the same chips:", bool(np.array_equal(decrypted(wrapped), chips)))

# %%
# A wrong key gives random chips and no error message. Only the correlation with the signal shows that the key is wrong.
figure, axes = plt.subplots(layout="constrained")
lag = np.arange(-60, 61)
wrong = hashlib.sha256(bytes(16)).digest()
for name, key in (("the right key", wrapped), ("another key", wrong)):
    found = decrypted(key)
    axes.plot(lag, [np.mean(np.roll(found, k) * chips) for k in lag], label=name)
axes.set(xlabel="lag (chips)", ylabel="correlation with the chips on air")
axes.legend()
plt.show()
