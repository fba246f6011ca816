"""Cases that tests and benchmarks share: simulated cameras and their shots, small profiles and LUTs, damaged files."""
