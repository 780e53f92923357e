"""Encode and decode the Galileo I/NAV message of E1-B with the same table: fields, words, pages, symbols."""
