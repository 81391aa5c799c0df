"""``python -m draglag_app``: the command line."""

from draglag_app.cli.main import main

if __name__ == "__main__":
    main()
