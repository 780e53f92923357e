"""Runs of many epochs: cut into chunks, measured by workers, written into a store that can be resumed, counted."""
