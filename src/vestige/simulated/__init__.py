"""Products of a scenario: snapshots, recordings, exported test cases."""
