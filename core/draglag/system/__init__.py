"""Installed packages, plugins by entry points, temporary files, and the threads of linear algebra."""
