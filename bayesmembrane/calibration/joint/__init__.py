"""Several measurements of one material: shared parameters of the energy, and for each its own effects and noise."""
