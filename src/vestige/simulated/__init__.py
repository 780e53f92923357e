"""What a scenario describes, made: snapshots, recordings, exported test cases."""
