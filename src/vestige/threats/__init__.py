"""The threat table: scenes of attacks, what came of each at every level, beside what was expected."""
