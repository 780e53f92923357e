"""Coding of I/NAV: the convolutional code and interleaver of half-pages, and the Reed–Solomon parity of words."""
