"""One component of every kind, as another package would add them to bayesmembrane."""
