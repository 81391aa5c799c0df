"""Installed packages, plugins, temporary files, threads of linear algebra."""
