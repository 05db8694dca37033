"""Measurements that a user can repeat; every figure is compared with another of the same run."""
