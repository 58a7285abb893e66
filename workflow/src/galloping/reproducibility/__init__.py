"""What makes a rerun exact: digests of code, jobs that leave a log."""
