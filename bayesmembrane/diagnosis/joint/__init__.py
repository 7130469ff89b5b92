"""Diagnosis of several tests of one material at once: one energy, and effects of the material or of a single test."""
