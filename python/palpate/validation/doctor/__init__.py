"""Fitness of a machine for a force loop at 1 kHz: ``palpate doctor``."""
