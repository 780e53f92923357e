"""The vestigial signal searches, and when they run."""
