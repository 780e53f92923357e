"""Read files as a source of snapshots: samples, E1 observations, navigation pages, assistance."""
