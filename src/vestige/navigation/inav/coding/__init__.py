"""Encode and decode I/NAV: convolutional code and interleaver of half-pages, Reed–Solomon parity of words."""
