"""The Galileo I/NAV message of E1-B, both ways: fields, words, pages, symbols. One table serves encoder and decoder."""
