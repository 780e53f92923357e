"""
How one OSNMA key proves another
================================

Use this example to understand what "validated" means. Each key of the chain is the hash of the next key. So a
receiver that knows a true key can check every later key. Only the operator can compute a key before the key is sent.
"""

# %%
# The operator draws the last key of the chain at random, and computes the earlier keys with the hash. The oldest key is
# the root key, which is signed.
import secrets

import matplotlib.pyplot as plt
import numpy as np

import vestige as vs
from vestige.crypto.osnma.messages.chain_parameters import ChainParameters
from vestige.crypto.osnma.messages.tesla import one_way

parameters = ChainParameters(key_size=4, alpha=bytes.fromhex("25d3964da3a2"))
start = vs.GalileoTime.parse("2026-11-21T12:00:00 GST")
last = secrets.token_bytes(parameters.key_bytes)
chain = [last]
for step in range(19, 0, -1):
    chain.insert(0, one_way(chain[0], start + 30 * (step - 1), parameters))
root, received = chain[0], chain[12]

# %%
# The receiver knows the root key. Six minutes later the receiver gets a key. Twelve hashes of this key must give
# the root key.


def hashed_down(key):
    """Return a key of 12:06:00 GST and its twelve hashes; the last hash of a true key is the root key."""
    keys = [key]
    for step in range(12, 0, -1):
        keys.append(one_way(keys[-1], start + 30 * (step - 1), parameters))
    return keys


forged = bytes([received[0] ^ 1]) + received[1:]  # one bit differs
print("received key:", hashed_down(received)[-1] == root)
print("forged key:  ", hashed_down(forged)[-1] == root)

# %%
# After one hash, the true and the forged key differ in about half of their bits. A forged key with a single wrong bit
# fails like any other forged key.
true_keys, forged_keys = (np.array([list(key) for key in hashed_down(one)], np.uint8) for one in (received, forged))
differ = np.unpackbits(true_keys ^ forged_keys, axis=1)
figure, axes = plt.subplots(layout="constrained")
axes.imshow(differ, aspect="auto", cmap="Greys", interpolation="nearest")
axes.set(xlabel="bit of the key", ylabel="hashes", title="Bits in which the forged chain differs (black)")
plt.show()
