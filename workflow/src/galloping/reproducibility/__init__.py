"""Exact reruns: digests of code, receipts of results, and jobs that leave a log."""
