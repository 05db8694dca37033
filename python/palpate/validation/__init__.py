"""Accuracy beside known answers, speed beside other methods, and their plots."""
