"""The ACAS processor on blocks of n epochs and m satellites: the one that process and campaigns will share.

It judges as `acas_processor` does, with every check written once. One snapshot is a block of one epoch, and how epochs
are cut into blocks changes no bit. The command line and campaigns still use `acas_processor`.
"""
