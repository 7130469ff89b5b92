"""``python -m bayesmembrane`` is the command line."""

from bayesmembrane.app.cli import main

if __name__ == "__main__":
    main()
