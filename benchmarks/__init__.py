"""Measurements that the README and the results pages are written from."""
