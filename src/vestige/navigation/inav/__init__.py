"""Encode and decode fields, words, pages and symbols of the Galileo I/NAV message on E1-B."""
