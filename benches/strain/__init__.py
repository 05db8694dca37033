"""Finite strain references: full Newton solutions that the laws for large strains are compared with."""
