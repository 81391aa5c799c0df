"""``python -m draglag_app``: the command line, where no script is on the path."""

from draglag_app.cli.main import main

if __name__ == "__main__":
    main()
